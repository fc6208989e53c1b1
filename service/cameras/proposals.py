"""The pose that is proposed for a camera without a prior pose: by its people, and by hints."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.errors import DegenerateGeometryError
from models.geometry.hints import Hint, HintKind, with_hints
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import PLANE_PARAMETERS, CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.geometry.usual_pose import CONFIRMABLE_SD, measured_precision, usual_pose, usual_sd
from service.store import cameras
from service.store.cameras import PriorPoseRecord, ProposedPoseRecord

_UNTOLD = 9.0  # times the variance of people who do not tell enough


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A proposed pose, estimated from tracks and hints, that an operator can confirm.

    `covariance` (3, 3) is of tilt, roll and log height; `sd` in radians and metres, of the heading,
    too, where a map tells it. `residual_sd` is the residual of each hint in its own
    standard deviations; None if no pose fits the hints.
    """

    pose: CameraPose
    covariance: list[list[float]]
    sd: dict[str, float]
    identifiable: tuple[str, ...]
    tracks: int
    walking_groups: int
    residual_sd: tuple[float, ...] | None
    updated_at: datetime

    @property
    def told(self) -> bool:
        """True if the pose is certain enough to be confirmed."""
        return len(self.identifiable) == len(PLANE_PARAMETERS)


def proposal_of(
    session: Session, prior: PriorPoseRecord, intrinsics: Intrinsics
) -> Proposal | None:
    """The proposal for a camera whose prior pose is assumed; None where nothing tells one."""
    people = cameras.proposed_pose(session, prior.id)
    hints = [hint_of(each) for each in prior.hints]
    if people is None and not hints:
        return None
    mean, known = _known(prior, people)
    residual_sd: tuple[float, ...] | None
    try:
        found = with_hints(mean, known, hints, intrinsics)
        residual_sd = found.residual_sd
    except (DegenerateGeometryError, np.linalg.LinAlgError):
        if people is None:
            return None
        hints, residual_sd = [], None
        found = with_hints(mean, known, hints, intrinsics)
    sd = np.sqrt(np.diag(found.covariance))
    if hints or people is None:
        named = zip(PLANE_PARAMETERS, sd[:3] <= CONFIRMABLE_SD, strict=True)
        identifiable = tuple(name for name, known_well in named if known_well)
    else:
        identifiable = tuple(people.identifiable)
    pose, (tilt, roll, log_height, heading) = found.pose, sd[:4].tolist()
    by_name = {"tilt_rad": tilt, "roll_rad": roll, "height_m": pose.height_m * log_height}
    if heading > 0:  # a map tells it
        by_name["heading_rad"] = heading
    return Proposal(
        pose=pose,
        covariance=found.covariance[:3, :3].tolist(),
        sd=by_name,
        identifiable=identifiable,
        tracks=0 if people is None else people.tracks,
        walking_groups=0 if people is None else people.walking_groups,
        residual_sd=residual_sd,
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
        **({"place_sd_m": kept["place_sd_m"]} if "place_sd_m" in kept else {}),
    )


def _known(prior: PriorPoseRecord, people: ProposedPoseRecord | None) -> tuple[Array, Array]:
    """The Gaussian (3,), (3, 3) beside the hints: the people's, or how cameras are mounted."""
    measured = prior.measured
    if people is None:
        return plane_parameters_of(usual_pose(measured)), np.diag(usual_sd(measured) ** 2)
    covariance = np.array(people.covariance)
    if len(people.identifiable) < len(PLANE_PARAMETERS):
        # The tracks are trusted less, the measurements among them are not.
        share = 1 / _UNTOLD
        by_tracks = share * np.linalg.inv(covariance)
        covariance = np.linalg.inv(by_tracks + (1 - share) * measured_precision(measured))
    return plane_parameters_of(people.pose), covariance
