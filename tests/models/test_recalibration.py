"""The calls that the service and the studies share: learn a site, estimate, read the chart."""

from dataclasses import replace

import pytest

from models.errors import ShapeError
from models.pose import (
    AlarmRate,
    estimate_pose,
    observe,
)
from studies.simulation.lanes import SiteConfig
from tests.models.sites import LENS, PRIOR

CONFIG = SiteConfig(aside_m=0.8, standing_share=0.0)
ONE_A_YEAR = AlarmRate(alarms_a_year=1.0, tracks_a_year=36_500.0)


def test_tracks_out_of_order_are_refused(site, tracks, call):
    gone_s = float(tracks[1][-1].time_s[-1] - tracks[1][0].time_s[-1])
    with pytest.raises(ShapeError, match="order of their ends, got one at 30 that ended") as told:
        refusals(site, tracks[1])[call]()
    assert f"{gone_s:g} s before the one at 29" in str(told.value)


def test_tracks_that_ended_together_are_in_order(site, tracks):
    """People who leave a train: ten at a time are seen no more. A cut never goes through them."""
    ends = [tracks[2][number - number % 10].time_s[-1] for number in range(60)]
    together = [
        replace(track, time_s=track.time_s - track.time_s[-1] + end_s)
        for track, end_s in zip(tracks[2], ends, strict=True)
    ]
    crowd = observe([*tracks[1], *together], LENS, PRIOR)
    found = estimate_pose(crowd, site)
    assert found.change_idx is not None
    assert found.first == 60 <= found.change_idx
