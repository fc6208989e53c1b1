"""The joint estimator as the protocol runs it, with and without what it may use."""

from dataclasses import replace

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.estimation.joint.estimate import JointEstimate, joint_estimate
from models.estimation.joint.observations import Observations, observe, of_tracks
from models.estimation.joint.reference import assumed_reference, learn_reference
from models.estimation.numbers import NUMBERS, numbers_of
from models.evaluation.protocol import (
    KNOCKED,
    Answer,
    Estimator,
    KnockRange,
    ProtocolCase,
    draw_case,
    nothing_told,
)
from models.evaluation.scenes import Scene
from models.flow.fusion import fused_estimate
from models.flow.reference import learn_flow
from models.simulation.walkers import WalkConfig
from models.trajectory import Trajectory

_SEED = 0


def joint(case: ProtocolCase) -> Answer:
    """As it is served: the site learned from the reference, boxes where they tell something."""
    return _answer(_with_reference(case, case.reference, case.seen))


def joint_feet(case: ProtocolCase) -> Answer:
    """Without boxes."""
    return _answer(_with_reference(case, _feet(case.reference), _feet(case.seen)))


def joint_assumed(case: ProtocolCase) -> Answer:
    """Without a reference: people are assumed to walk at 1.4 m/s, everywhere alike."""
    seen = observe(case.seen, case.intrinsics)
    try:
        reference = assumed_reference(seen, case.prior_pose, WalkConfig())
    except TooFewTrajectoriesError:
        return nothing_told(case)
    return _answer(joint_estimate(seen, case.prior_pose, reference))


def fused(case: ProtocolCase) -> Answer:
    """The joint estimate and the flow map together: the heading too."""
    known, seen = (observe(tracks, case.intrinsics) for tracks in (case.reference, case.seen))
    site = learn_reference(known, case.prior_pose, WalkConfig(), _SEED)
    estimate = joint_estimate(seen, case.prior_pose, site)
    flow = learn_flow(known, case.intrinsics, case.prior_pose, _SEED)
    if flow is None:
        return _answer(estimate)
    found = fused_estimate(seen, case.intrinsics, case.prior_pose, estimate, flow)
    answer = replace(
        _answer(estimate),
        values=found.values[:3],
        covariance=found.covariance[:3, :3],
        weak=tuple(name for name in NUMBERS if name not in found.told),
    )
    if "heading" not in found.told:
        return answer
    return replace(
        answer,
        heading_rad=float(found.values[3]),
        heading_sd_rad=float(np.sqrt(found.covariance[3, 3])),
    )


JOINT: dict[str, Estimator] = {
    "joint": joint,
    "joint, feet only": joint_feet,
    "joint, no reference": joint_assumed,
    "fused": fused,
}


def track_errors(
    scene: Scene, seed: int, counts: list[int], knock_range: KnockRange = KNOCKED
) -> list[tuple[int, float, float]]:
    """For some numbers of tracks after a knock: tracks, angle error, its bound; both in degrees.

    The bound is Cramer and Rao's for the estimator's own likelihood: the root of the summed
    variances of tilt and roll.
    """
    case = draw_case(scene, seed, knock_range)
    reference = learn_reference(
        observe(case.reference, case.intrinsics), case.prior_pose, WalkConfig(), _SEED
    )
    seen = observe(case.seen, case.intrinsics)
    order = np.random.default_rng(seed).permutation(seen.tracks)
    found = []
    for count in counts:
        if count > seen.tracks:
            break
        some: Observations = of_tracks(seen, np.sort(order[:count]))
        estimate = joint_estimate(some, case.prior_pose, reference)
        error = np.degrees(estimate.values - numbers_of(case.true_pose))[:2]
        bound = np.degrees(np.sqrt(np.trace(estimate.bound[:2, :2])))
        found.append((count, float(np.hypot(*error)), float(bound)))
    return found


def _with_reference(
    case: ProtocolCase, known: tuple[Trajectory, ...], seen: tuple[Trajectory, ...]
) -> JointEstimate:
    reference = learn_reference(
        observe(known, case.intrinsics), case.prior_pose, WalkConfig(), _SEED
    )
    return joint_estimate(observe(seen, case.intrinsics), case.prior_pose, reference)


def _feet(trajectories: tuple[Trajectory, ...]) -> tuple[Trajectory, ...]:
    return tuple(replace(trajectory, top_v=None) for trajectory in trajectories)


def _answer(estimate: JointEstimate) -> Answer:
    return Answer(
        values=estimate.values,
        covariance=estimate.covariance,
        tracks=estimate.walkers,
        weak=estimate.weak,
    )
