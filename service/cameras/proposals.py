"""The pose that is proposed for a camera without a prior pose: by its people, and by hints."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.errors import DegenerateGeometryError
from models.geometry.hints import Hint, HintedPose, HintKind, with_hints
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import PLANE_PARAMETERS, CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.geometry.usual_pose import AGREED_SD, usual_pose, usual_sd
from service.store import cameras
from service.store.cameras import PriorPoseRecord, ProposedPoseRecord

_UNTOLD = 9.0  # times the variance of people who do not tell enough


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A pose to agree to, of so many tracks and hints.

    `covariance` (3, 3) is of tilt, roll and log height; `sd` in radians and metres, of the heading,
    too, where a map tells it. `off_sd` is how far each hint is off, in its own standard deviations;
    None where they do not fit any pose.
    """

    pose: CameraPose
    covariance: list[list[float]]
    sd: dict[str, float]
    identifiable: tuple[str, ...]
    tracks: int
    walking_groups: int
    off_sd: tuple[float, ...] | None
    updated_at: datetime

    @property
    def told(self) -> bool:
        """True where there is enough to agree to."""
        return len(self.identifiable) == len(PLANE_PARAMETERS)


def proposal_of(
    session: Session, prior: PriorPoseRecord, intrinsics: Intrinsics
) -> Proposal | None:
    """The proposal for a camera whose prior pose is assumed; None where nothing tells one."""
    people = cameras.proposed_pose(session, prior.id)
    hints = [hint_of(each) for each in prior.hints]
    if people is None and not hints:
        return None
    mean, covariance = _known(prior, people)
    hinted = None
    try:
        hinted = with_hints(mean, covariance, hints, intrinsics)
    except (DegenerateGeometryError, np.linalg.LinAlgError):
        if people is None:
            return None
    pose = CameraPose(height_m=math.exp(mean[2]), tilt_rad=float(mean[0]), roll_rad=float(mean[1]))
    identifiable = () if people is None else tuple(people.identifiable)
    heading: dict[str, float] = {}
    if hinted is not None and hints:
        pose, covariance = hinted.pose, hinted.covariance[:3, :3]
        heading = _heading_sd(hinted)
        sd = np.sqrt(np.diag(covariance))
        named = zip(PLANE_PARAMETERS, sd <= AGREED_SD, strict=True)
        identifiable = tuple(name for name, known in named if known)
    tilt, roll, log_height = np.sqrt(np.diag(covariance)).tolist()
    return Proposal(
        pose=pose,
        covariance=covariance.tolist(),
        sd={"height_m": pose.height_m * log_height, "tilt_rad": tilt, "roll_rad": roll, **heading},
        identifiable=identifiable,
        tracks=0 if people is None else people.tracks,
        walking_groups=0 if people is None else people.walking_groups,
        off_sd=None if hinted is None else hinted.off_sd,
        updated_at=prior.created_at if people is None else people.created_at,
    )


def hint_of(kept: dict[str, Any]) -> Hint:
    """A hint as it is stored."""
    place = kept.get("place_m")
    return Hint(
        kind=HintKind(kept["kind"]),
        points=np.array(kept["points"], dtype=np.float64),
        length_m=kept.get("length_m"),
        place_m=None if place is None else (place[0], place[1]),
    )


def _known(prior: PriorPoseRecord, people: ProposedPoseRecord | None) -> tuple[Array, Array]:
    """The Gaussian (3,), (3, 3) beside the hints: people's, or how cameras are hung."""
    if people is None:
        measured = prior.measured
        return plane_parameters_of(usual_pose(measured)), np.diag(usual_sd(measured) ** 2)
    told = len(people.identifiable) == len(PLANE_PARAMETERS)
    covariance = np.array(people.covariance) * (1.0 if told else _UNTOLD)
    return plane_parameters_of(people.pose), covariance


def _heading_sd(hinted: HintedPose) -> dict[str, float]:
    variance = float(hinted.covariance[3, 3])
    return {"heading_rad": math.sqrt(variance)} if variance > 0 else {}
