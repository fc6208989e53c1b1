"""The smallest moves that would be told, against the posterior itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.geometry.pose import PARAMETERS
from models.pose import pose_posterior
from models.pose.power import PEOPLE, smallest_told
from tests.models.test_hypotheses import PRIOR, SD, estimate


def told(fused=None, groups=200, people=250, reference=np.inf):
    return smallest_told(fused or estimate(), groups, people, reference)


def test_nine_of_ten_windows_with_the_smallest_move_are_told():
    groups = 200
    found = told(groups=groups)[:, list(PEOPLE).index(250)]
    rng = np.random.default_rng(5)
    for number, name in enumerate(PARAMETERS):
        noise = rng.normal(0, SD[number], 400)
        field = "log_height" if name == "height" else name
        unit = 1.0 if name == "height" else 180 / math.pi
        seen = [
            pose_posterior(estimate(**{field: (found[number] + off) * unit}), groups, PRIOR).moved
            for off in noise
        ]
        share = np.mean([each >= 0.9 for each in seen])
        assert share == pytest.approx(0.9, abs=0.06), name


def test_more_people_tell_smaller_moves_down_to_what_the_reference_is_unsure_of():
    endless, small = told(), told(reference=300.0)
    assert (np.diff(endless, axis=1) < 0).all()
    assert (np.diff(small, axis=1) < 0).all()
    assert (small[:, 0] < endless[:, 0]).all()  # what the window has of the reference stays
    assert (small[:, 2] > endless[:, 2]).all()


def test_what_the_tracks_do_not_tell_is_not_told():
    deaf = told(replace(estimate(), raw=None))
    assert np.isnan(deaf[3]).all()
    assert not np.isnan(deaf[:3]).any()
    assert np.isnan(told(groups=2, people=2)).all()
