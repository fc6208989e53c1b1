"""The base model as the protocol runs it: no training, for any camera."""

from functools import cache

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.estimation.parameters import PLANE_PARAMETERS, PlaneEstimate, identifiable_of
from models.evaluation.protocol.cases import Answer, ProtocolCase, nothing_identifiable
from models.evaluation.protocol.learned import Learned
from models.regression.base.network import SetNetwork
from models.regression.base.prediction import base_estimate
from models.regression.base.segments import segments_of
from models.regression.base.stored import load_base_model


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
    """What the shipped base model says of a case.

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
