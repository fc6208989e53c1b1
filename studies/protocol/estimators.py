"""The estimators of the protocol that need no training, by the names of its tables."""

from functools import cache

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import (
    PLANE_PARAMETERS,
    identifiable_of,
    plane_parameters_of,
)
from models.pose import observe
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations, of_tracks
from models.tracks.scenes import Scene
from models.walking.estimate import JointEstimate, joint_estimate
from models.walking.reference_learning import learn_speed_reference
from models.walking.speed_reference import assumed_speed_reference
from studies.base_model.network import SetNetwork
from studies.base_model.prediction import base_estimate
from studies.base_model.segments import segments_of
from studies.base_model.stored import load_base_model
from studies.plane_estimate import PlaneEstimate
from studies.protocol.cases import (
    KNOCKED,
    Answer,
    OffsetRange,
    ProtocolCase,
    draw_case,
    nothing_identifiable,
)
from studies.protocol.flow_runs import fused, registration
from studies.protocol.learned import Learned, LearnedEstimator

_SEED = 0


def base_model(learned: Learned) -> Answer:
    """By the base model, with the reference beside what is seen; boxes and the map have no part."""
    try:
        estimate = base_estimate_of(learned.case)
    except TooFewTrajectoriesError:
        return nothing_identifiable(learned.case)
    sd = np.sqrt(np.diag(estimate.covariance))
    return Answer(
        values=estimate.values,
        covariance=estimate.covariance,
        tracks=estimate.tracks,
        identifiable=identifiable_of(PLANE_PARAMETERS, sd),
    )


def base_estimate_of(case: ProtocolCase) -> PlaneEstimate:
    """Estimate of the shipped base model in a case.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks that walk.
    """
    seen, reference = (
        segments_of(tracks, case.intrinsics) for tracks in (case.seen, case.reference)
    )
    return base_estimate(_network(), case.intrinsics, case.prior_pose, seen, reference)


@cache
def _network() -> SetNetwork:
    return load_base_model()


def joint(learned: Learned) -> Answer:
    """By speeds alone: the site learned from the reference, boxes where they count."""
    return joint_answer(
        joint_estimate(learned.seen, learned.case.prior_pose, learned.site.speed_reference)
    )


def joint_feet(learned: Learned) -> Answer:
    """Without boxes."""
    return joint_answer(
        joint_estimate(learned.feet, learned.case.prior_pose, learned.feet_speed_reference)
    )


def joint_assumed(learned: Learned) -> Answer:
    """Without a reference: people are assumed to walk at 1.4 m/s, everywhere alike."""
    prior = learned.case.prior_pose
    try:
        reference = assumed_speed_reference(learned.seen, prior, WalkConfig())
    except TooFewTrajectoriesError:
        return nothing_identifiable(learned.case)
    return joint_answer(joint_estimate(learned.seen, prior, reference))


def joint_answer(estimate: JointEstimate) -> Answer:
    """A joint estimate as an answer of the protocol."""
    return Answer(
        values=estimate.values,
        covariance=estimate.covariance,
        tracks=estimate.walkers,
        identifiable=estimate.identifiable,
    )


def track_errors(
    scene: Scene, seed: int, counts: list[int], offset_range: OffsetRange = KNOCKED
) -> list[tuple[int, float, float]]:
    """For some numbers of tracks after a knock: tracks, angle error, its bound; both in degrees.

    The bound is Cramer and Rao's for the estimator's own likelihood: the root of the summed
    variances of tilt and roll.
    """
    case = draw_case(scene, seed, offset_range)
    reference = learn_speed_reference(
        observe(case.reference, case.intrinsics, case.prior_pose),
        case.prior_pose,
        WalkConfig(),
        _SEED,
    )
    seen = observe(case.seen, case.intrinsics, case.prior_pose)
    order = np.random.default_rng(seed).permutation(seen.tracks)
    found = []
    for count in counts:
        if count > seen.tracks:
            break
        some: Observations = of_tracks(seen, np.sort(order[:count]))
        estimate = joint_estimate(some, case.prior_pose, reference)
        error = np.degrees(estimate.values - plane_parameters_of(case.true_pose))[:2]
        bound = np.degrees(np.sqrt(np.trace(estimate.bound[:2, :2])))
        found.append((count, float(np.hypot(*error)), float(bound)))
    return found


UNTRAINED: dict[str, LearnedEstimator] = {
    "base model": base_model,
    "joint": joint,
    "joint, feet only": joint_feet,
    "joint, no reference": joint_assumed,
    "registration": registration,
    "fused": fused,
}
