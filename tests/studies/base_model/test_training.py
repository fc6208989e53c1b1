from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from models.errors import CheckpointError, DegenerateGeometryError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from studies.base_model.features import FEATURES, SHORT
from studies.base_model.making import held_out_figures
from studies.base_model.sets import SimulatedSets, SiteRange, sets_before
from studies.base_model.training import BasePlan, BaseTraining, student_loss

pytestmark = pytest.mark.slow

SMALL = BasePlan(seed=3, rounds=2, cameras=1, sites_each=4, people=12, passes=2, batch=8)


def weights(training: BaseTraining) -> torch.Tensor:
    return torch.cat([part.flatten() for part in training.network.state_dict().values()])


def test_the_seed_alone_makes_it_and_it_goes_on_where_it_was_ended(tmp_path: Path):
    straight, ended, other = (BaseTraining(plan) for plan in (SMALL, SMALL, replace(SMALL, seed=4)))
    torch.manual_seed(9)
    losses = [straight.work_round() for _ in range(2)]
    assert np.isfinite(losses).all()
    ended.work_round()
    ended.save(tmp_path / "kept")
    resumed = BaseTraining(SMALL)
    resumed.go_on(tmp_path / "kept")
    assert resumed.done == 1
    assert resumed.work_round() == losses[1]
    assert torch.equal(weights(resumed), weights(straight))
    other.work_round()
    assert not torch.equal(weights(ended), weights(other))


def test_what_is_no_training_is_refused(tmp_path: Path):
    (tmp_path / "kept").write_bytes(b"of something else")
    with pytest.raises(CheckpointError, match="no training to go on with"):
        BaseTraining(SMALL).go_on(tmp_path / "kept")


def test_sets_know_their_offsets_and_segments_are_of_people_who_walk():
    data = replace(SMALL, cameras=6, sites_each=10, people=24).sets(0)
    assert data.seen.shape[1:] == (24, FEATURES)
    assert np.isfinite(data.seen).all()
    assert (data.seen_mask.sum(1) >= 3).all()
    assert 0.05 < (~data.reference_mask.any(1)).mean() < 0.3
    # A look from the prior pose may be far off; one from where an answer ended is near.
    far = np.abs(data.offsets[:, :2]).max(1)
    assert 0.2 < (far < np.radians(5)).mean() < 0.95


def before(lens: Intrinsics, pose: CameraPose, ranges: SiteRange) -> SimulatedSets:
    return sets_before(lens, pose, ranges, 40, 24, np.random.default_rng(0))[0]


def test_a_higher_camera_sees_shorter_ways(lens: Intrinsics, pose: CameraPose):
    level = SiteRange(
        angle_rad=0.0, prior_sd=(0.0, 0.0, 0.0), near_share=1.0, habit_log_sd=0.0,
        log_focal_sd=0.0, no_reference_share=0.0,
    )  # fmt: skip
    data = before(lens, pose, level)
    assert np.abs(data.offsets[:, :2]).max() < 1e-9
    paces = [
        np.median(seen[there, SHORT]) - np.median(reference[known, SHORT])
        for seen, there, reference, known in zip(
            data.seen, data.seen_mask, data.reference, data.reference_mask, strict=True
        )
    ]
    assert np.polyfit(data.offsets[:, 2], paces, 1)[0] == pytest.approx(1, abs=0.2)


def test_a_camera_that_looks_up_has_no_sites(lens: Intrinsics, pose: CameraPose):
    with pytest.raises(DegenerateGeometryError):
        before(lens, replace(pose, tilt_rad=-1.3), SiteRange(angle_rad=0.0))


def test_the_loss_is_least_near_the_truths_own_spread():
    truth = torch.randn(4000, 3, generator=torch.Generator().manual_seed(0))
    losses = {
        log_sd: float(student_loss(torch.zeros(4000, 3), torch.full((4000, 3), log_sd), truth))
        for log_sd in (-1.0, -0.2, 0.6)
    }
    assert min(losses, key=losses.__getitem__) == -0.2
    shifted = float(student_loss(torch.full((4000, 3), 0.5), torch.full((4000, 3), -0.2), truth))
    assert shifted > losses[-0.2]


def test_figures_are_medians_in_degrees_and_per_cent():
    class Silent(torch.nn.Module):
        def forward(self, seen: torch.Tensor, *_: torch.Tensor) -> tuple[torch.Tensor, ...]:
            return torch.zeros(len(seen), 3), torch.zeros(len(seen), 3), torch.zeros(len(seen), 3)

    empty = np.zeros((4, 2, FEATURES))
    data = SimulatedSets(
        seen=empty, seen_mask=np.ones((4, 2), bool), reference=empty,
        reference_mask=np.array([[True, True]] * 3 + [[False, False]]),
        offsets=np.array([[0.01, 0.02, 0.1], [0.03, 0.02, 0.3], [0.2, 0.0, 2.0], [0.0, 0.0, 0.5]]),
    )  # fmt: skip
    found = held_out_figures(Silent(), data)
    assert found["with a reference, within 6 deg"] == {
        "sets": 2, "off": [1.15, 1.15, 20.0], "moved": [1.15, 1.15, 20.0], "covered": [1, 1, 1],
    }  # fmt: skip
    assert found["with a reference, farther off"]["covered"] == [1, 1, 0]
    assert found["without a reference"]["sets"] == 1
