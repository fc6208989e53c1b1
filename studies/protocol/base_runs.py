"""The base model as the protocol runs it: no training, for any camera."""

from functools import cache

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.plane_parameters import PLANE_PARAMETERS, PlaneEstimate, identifiable_of
from studies.base_model.network import SetNetwork
from studies.base_model.prediction import base_estimate
from studies.base_model.segments import segments_of
from studies.base_model.stored import load_base_model
from studies.protocol.cases import Answer, ProtocolCase, nothing_identifiable
from studies.protocol.learned import Learned


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
