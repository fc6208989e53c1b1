"""The evidence that is kept with an alert: what an estimate was by, in numbers, and no people."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from models.geometry.pose import FIELDS, PARAMETERS, CameraPose, PoseParameters, array_of
from models.geometry.rotation import Array
from models.pose import PEOPLE, FusedEstimate, Hypothesis, PosePosterior
from service.estimation.compute import ComputedEstimate
from service.estimation.moved_zones import MovedZones

_HYPOTHESES = 8


def alert_evidence(found: ComputedEstimate, prior: CameraPose) -> dict[str, Any]:
    """The numbers behind a verdict; angles in radians."""
    assessment = found.assessment
    joint, fused = assessment.estimated.joint, assessment.estimated.fused
    return {
        **told_by(assessment.posterior, fused.values - array_of(prior), found.zones),
        "tracks": len(found.tracks),
        "walking_groups": joint.walking_groups,
        "from_s": found.tracks[0].started_s,
        "to_s": found.tracks[-1].ended_s,
        "offset_sd": asdict(PoseParameters.sd_of_array(fused.covariance, prior.height_m)),
        "registered": fused.registered,
        "prior_loss_sd": fused.prior_loss,
        "alternatives": alternatives_of(fused),
        "chart": _picked(assessment.chart, "statistic", "level", "walking_groups"),
        "creep": _picked(assessment.slow_drift, "statistic", "level"),
    }


def told_by(posterior: PosePosterior, offset: Array, zones: MovedZones | None) -> dict[str, Any]:
    """What any witness tells, of an `offset` (4,) from the prior pose; of people, nothing yet."""
    prior = posterior.prior
    likeliest = posterior.likeliest(_HYPOTHESES)
    return {
        "tracks": 0,
        "walking_groups": 0,
        "moved": posterior.moved,
        "hypotheses": [_hypothesis(each, prior) for each in likeliest],
        "offset": _named(offset, prior),
        "registered": False,
        "prior_loss_sd": 0.0,
        "alternatives": [],
        "chart": None,
        "creep": None,
        "zones": None if zones is None else asdict(zones),
    }


def _picked(result: object | None, *names: str) -> dict[str, Any] | None:
    return None if result is None else {name: getattr(result, name) for name in names}


def alternatives_of(fused: FusedEstimate) -> list[dict[str, Any]]:
    """Other poses that explain the tracks, each with its weight among all that do."""
    return [
        {**asdict(PoseParameters.of_array(alternative.values)), "weight": alternative.weight}
        for alternative in fused.alternatives
    ]


def detectable(power: Array | None, prior: CameraPose) -> dict[str, Any]:
    """The smallest move in each parameter that is told of so many people; None where none is."""
    if power is None:
        return {}
    found: dict[str, Any] = {"people": PEOPLE.tolist()}
    for name, row in zip(PARAMETERS, power, strict=True):
        smallest = prior.height_m * np.expm1(row) if name == "height" else row
        found[FIELDS[name]] = smallest.tolist() if np.isfinite(row).all() else None
    return found


def _hypothesis(each: Hypothesis, prior: CameraPose) -> dict[str, Any]:
    return {
        "moved": list(each.moved),
        "far": each.far,
        "weight": each.weight,
        "offset": _named(each.offset, prior),
    }


def _named(offset: Array, prior: CameraPose) -> dict[str, float]:
    """An offset (4,) of tilt, roll, log height, heading, named; within half a turn."""
    tilt, roll, log_height, heading = offset.tolist()
    return {
        "tilt_rad": tilt,
        "roll_rad": math.remainder(roll, 2 * math.pi),
        "height_m": prior.height_m * math.expm1(log_height),
        "heading_rad": math.remainder(heading, 2 * math.pi),
    }
