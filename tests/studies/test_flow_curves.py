"""Errors of the fused pose over the number of tracks, and the pictures of the flow map."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from models.tracks.scenes import Scene, SceneTrack
from studies.protocol import flow_curves
from studies.protocol.cases import PANNED, draw_case
from studies.protocol.flow_curves import CurvePoint, flow_errors
from studies.protocol.flow_plots import curve_of, plot_flow, plot_flow_errors
from studies.protocol.learned import learn_case
from studies.simulation.lanes import SiteConfig
from tests.models.sites import LENS, PRIOR, tracks_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scene() -> Scene:
    (tracks,) = tracks_of(3, (PRIOR, 160), config=SiteConfig(aside_m=0.8, standing_share=0.0))
    return Scene(
        scene_id="simulated",
        intrinsics=LENS,
        true_pose=PRIOR,
        frame_rate_hz=25,
        tracks=tuple(
            SceneTrack(track_id=str(number), trajectory=track, person_id=str(number))
            for number, track in enumerate(tracks)
        ),
    )


@pytest.fixture(scope="module")
def points(scene) -> list[CurvePoint]:
    return flow_errors(scene, 1, [2, 10, 40, 500])


def test_both_numbers_are_varied_and_all_tracks_end_each_line(scene, points):
    case = draw_case(scene, 1, PANNED)
    for varied, whole in (("reference", case.reference), ("seen", case.seen)):
        own = [point for point in points if point.varied == varied and point.asked != 2]
        assert [point.asked for point in own] == [10, 40, None]
        assert [point.tracks for point in own] == [10, 40, len(whole)]
    ends = [point.angle_error_deg for point in points if point.asked is None]
    assert ends[0] == ends[1] < 1.5
    # Ten people make no map: the pan of the knock stays in the error.
    pan_deg = math.degrees(case.true_pose.heading_rad - PRIOR.heading_rad)
    assert points[0].angle_error_deg > abs(pan_deg) / 2 > 1


def test_too_few_for_any_estimate_are_left_out(points):
    assert [point.varied for point in points if point.asked == 2] == ["seen"]


def test_a_curve_has_medians_of_the_numbers_that_all_seeds_have():
    points = [
        CurvePoint(varied="seen", asked=asked, tracks=tracks, angle_error_deg=error)
        for asked, tracks, error in (
            (None, 50, 0.5), (10, 10, 4.0), (40, 40, 9.0),
            (None, 30, 0.7), (10, 10, 2.0),
            (None, 70, 0.2), (10, 10, 3.0),
        )
    ]  # fmt: skip
    assert_allclose(curve_of(points), [[10, 3.0], [50, 0.5]])
    assert curve_of([]).shape == (0, 2)


def test_pictures_are_written(scene, tmp_path):
    learned = learn_case(draw_case(scene, 1, PANNED))
    assert learned.site.paths is not None
    turned = replace(PRIOR, heading_rad=0.1)
    plot_flow(learned, {"prior": PRIOR, "fused": turned}, tmp_path / "flow.png")
    points = [
        CurvePoint(varied=varied, asked=asked, tracks=asked, angle_error_deg=20 / asked)
        for varied in ("reference", "seen")
        for asked in (10, 20)
    ]
    plot_flow_errors({"street": points}, tmp_path / "errors.png")
    for name in ("flow.png", "errors.png"):
        assert (tmp_path / name).stat().st_size > 5000


def test_smaller_numbers_are_of_the_same_tracks(scene):
    case = draw_case(scene, 1, PANNED)
    whole = flow_curves.observe(case.seen, LENS, case.prior_pose)
    few, more, every = flow_curves._parts(whole, [5, 20, 1000], 1)
    assert (few.tracks, more.tracks, every) == (5, 20, whole)
    starts = [set(np.round(part.steps.start_rays[:, 0], 9)) for part in (few, more)]
    assert starts[0] <= starts[1]
