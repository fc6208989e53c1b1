"""Hints: what a person has marked in the picture of a camera that nobody has calibrated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from service.access.activity import note
from service.cameras.cameras import require_camera
from service.cameras.proposals import Proposal, proposal_of
from service.enums import Activity, PoseState
from service.errors import ConflictError, MalformedError
from service.notifications.events import tell_of_camera
from service.store import cameras


@dataclass(frozen=True, slots=True, kw_only=True)
class HintsView:
    """Hints as they are kept, and the pose that they and people make."""

    kept: Sequence[dict[str, Any]]
    proposed: Proposal | None


def view_hints(session: Session, camera_id: str) -> HintsView:
    """The hints of a camera; none of one that has a prior pose.

    Raises:
        NotFoundError: there is no such camera.
    """
    lens = require_camera(session, camera_id).intrinsics
    prior = cameras.prior_pose(session, camera_id)
    if not prior.assumed:
        return HintsView(kept=(), proposed=None)
    return HintsView(kept=prior.hints, proposed=proposal_of(session, prior, lens))


def keep_hints(session: Session, camera_id: str, kept: list[dict[str, Any]]) -> HintsView:
    """Keep hints in place of those there were.

    Raises:
        NotFoundError: there is no such camera.
        ConflictError: it has a prior pose.
        MalformedError: they fit no pose.
    """
    lens = require_camera(session, camera_id).intrinsics
    prior = cameras.prior_pose(session, camera_id)
    if not prior.assumed:
        raise ConflictError("hints: the camera has a prior pose already")
    prior.hints = kept
    proposed = proposal_of(session, prior, lens)
    if kept and (proposed is None or proposed.residual_sd is None):
        raise MalformedError.of_field(
            "hints", "they fit no pose: one that should be on the ground is above the horizon"
        )
    details = {"fields": ["hints"]}
    note(session, Activity.CAMERA_CHANGED, by=None, camera_id=camera_id, details=details)
    tell_of_camera(session, camera_id, state=PoseState.UNCALIBRATED)
    return HintsView(kept=kept, proposed=proposed)
