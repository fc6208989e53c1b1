"""No window that hypothesis draws takes more nodes or memory than a look has budget for.

A short version; an hour of it, which asks for CPU, too: `python -m tests.cost --windows 2000`.
"""

import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from models.geometry.intrinsics import Intrinsics
from models.tracks.trajectory import Trajectory, most_nodes
from models.tracks.walks import observe_each
from tests.cost.drawn import HEIGHT, WIDTH, crowds, tracks_of, windows
from tests.cost.looks import LOOK_MB, looker

LENS = Intrinsics(width=WIDTH, height=HEIGHT, fx=1100, fy=1100, cx=639.5, cy=359.5)


@settings(deadline=None)
@given(crowds(most_points=2_000))
def test_nodes_are_as_many_as_a_budget_counts_on_at_most(crowd):
    trajectories = [
        Trajectory(time_s=track.points[:, 0].copy(), uv=track.points[:, 1:].copy())
        for track in tracks_of(crowd, 1.7e9, "t")
    ]
    rows = observe_each(trajectories, LENS).steps.rows
    made = np.bincount(rows.owner_idx, minlength=len(trajectories))
    for trajectory, steps in zip(trajectories, made, strict=True):
        assert steps < most_nodes(trajectory.time_s.size, trajectory.duration_s) or not steps


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of memory is Linux's to tell")
def test_no_window_is_beyond_the_budget_of_a_look(tmp_path):
    with looker(tmp_path / "data") as found:

        @settings(
            max_examples=8, deadline=None, database=None, suppress_health_check=list(HealthCheck)
        )
        @given(windows(most_points=20_000))
        def look(window):
            drawn, checked = window
            cost = found.look(drawn, checked=checked)
            assert cost.error is None
            assert cost.peak_mb < LOOK_MB

        look()
