"""The evidence that is kept with an alert: what an estimate was by, in numbers, and no people."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from models.geometry.pose import FIELDS, PARAMETERS, CameraPose, PoseParameters, array_of
from models.geometry.rotation import Array
from models.pose import PEOPLE, Hypothesis, PosePosterior
from service.estimation.finding import Finding

_HYPOTHESES = 8


def alert_evidence(finding: Finding, prior: CameraPose) -> dict[str, Any]:
    """All that the verdict on a finding hangs on; angles in radians."""
    fused, joint, chart, creep = finding.fused, finding.joint, finding.reading, finding.creep
    return {
        "tracks": len(finding.tracks),
        "walking_groups": joint.walking_groups,
        "from_s": finding.tracks[0].started_s,
        "to_s": finding.tracks[-1].ended_s,
        "moved": finding.posterior.moved,
        "hypotheses": hypotheses_of(finding.posterior, prior),
        "offset": offset_of(fused.values - array_of(prior), prior),
        "offset_sd": asdict(PoseParameters.sd_of_array(fused.covariance, prior.height_m)),
        "registered": fused.registered,
        "prior_loss_sd": fused.prior_loss,
        "rivals": rivals_of(finding),
        "chart": None
        if chart is None
        else {
            "statistic": chart.statistic,
            "level": chart.level,
            "walking_groups": chart.walking_groups,
        },
        "creep": None if creep is None else {"statistic": creep.statistic, "level": creep.level},
        "zones": None if finding.zones is None else asdict(finding.zones),
    }


def hypotheses_of(posterior: PosePosterior, prior: CameraPose) -> list[dict[str, Any]]:
    """The likeliest hypotheses of what moved, with their weights."""
    return [_hypothesis(each, prior) for each in posterior.likeliest(_HYPOTHESES)]


def rivals_of(finding: Finding) -> list[dict[str, Any]]:
    """Other poses that explain the tracks, each with its weight among all that do."""
    return [
        {**asdict(PoseParameters.of_array(rival.values)), "weight": rival.weight}
        for rival in finding.fused.rivals
    ]


def would_notice(power: Array | None, prior: CameraPose) -> dict[str, Any]:
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
        "offset": offset_of(each.offset, prior),
    }


def offset_of(offset: Array, prior: CameraPose) -> dict[str, float]:
    """An offset (4,) of tilt, roll, log height, heading, named; within half a turn."""
    tilt, roll, log_height, heading = offset.tolist()
    return {
        "tilt_rad": tilt,
        "roll_rad": math.remainder(roll, 2 * math.pi),
        "height_m": prior.height_m * math.expm1(log_height),
        "heading_rad": math.remainder(heading, 2 * math.pi),
    }
