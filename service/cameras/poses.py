"""The served pose, from the store alone, with its reasons, and its history."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from models.geometry.pose import CameraPose
from models.reasons import Reason, Value
from models.walking.config import FEWEST_WALKERS
from service.alerts.data_gaps import data_gap_of
from service.cameras.cameras import no_camera, require_camera
from service.cameras.image_sizes import ImageQuestion, question_of
from service.cameras.proposals import Proposal, proposal_of
from service.cameras.reference_views import ReferenceView, reference_views
from service.cameras.status import CameraStatus, camera_statuses
from service.enums import PoseState
from service.notifications.outbox import json_time
from service.reasons import Reasons, ServiceCode
from service.references import wanted_tracks, window_beside
from service.settings import Settings
from service.store import cameras, estimates, pictures, references, windows
from service.store.estimates import EstimateRecord
from service.store.references import MaintenanceRecord
from service.wording.reasons import in_words


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseView:
    """The served pose of a camera, and its status.

    `calibrated` is true once a prior pose was given or confirmed; until then `proposed` is the pose
    estimated from tracks, None if there are too few. `question` is open about the image size
    of its tracks, until which nothing is learned from them. `estimates` are those of each
    estimator, and of the newest image that was compared.
    """

    status: CameraStatus
    calibrated: bool
    proposed: Proposal | None
    reasons: Reasons
    pose: CameraPose
    reference: ReferenceView
    model_id: str | None
    checked_at: datetime | None
    question: ImageQuestion | None
    estimates: dict[str, Any]
    etag: str

    @property
    def reason(self) -> str:
        """The reasons in words."""
        return in_words(self.reasons)


def view_pose(session: Session, settings: Settings, camera_id: str) -> PoseView:
    """The served pose, from the store alone.

    Raises:
        NotFoundError: there is no such camera.
    """
    set_up = cameras.as_set_up(session, camera_id)
    if set_up is None:
        raise no_camera(camera_id)
    camera, prior, model_id = set_up
    status = camera_statuses(session, settings, (camera_id,))[camera_id]
    if status.in_question:
        status = replace(status, estimate=None)  # it is from the tracks in question
    reference = reference_views(session, settings, {camera_id: status})[camera_id]
    pose, calibrated = prior.pose, not prior.assumed
    proposed = (
        None if calibrated or status.in_question else proposal_of(session, prior, camera.intrinsics)
    )
    reasons = _reasons_of(session, settings, status, reference, proposed)
    if proposed is not None:
        pose = proposed.pose
    estimate = status.estimate
    if estimate is not None:
        pose = replace(pose, **asdict(estimate.pose))
    estimate_id = None if estimate is None else estimate.id
    raw = {} if estimate is None else dict(estimate.raw)
    raw.pop("picture", None)  # that of the estimate; clients see the newest
    if (image := pictures.compared(session, camera_id, prior.id)) is not None:
        raw["picture"] = image.as_estimate
    # All that the answers are made of: the lens of `pose.yaml`, and reasons by their values, since
    # words round them.
    why, lens = (reasons, in_words(reasons)), camera.intrinsics
    checked = camera.checked_at
    served = (status.state.value, why, pose, estimate_id, raw, reference, model_id, lens, checked)
    return PoseView(
        status=status,
        calibrated=calibrated,
        proposed=proposed,
        reasons=reasons,
        pose=pose,
        reference=reference,
        model_id=model_id,
        checked_at=checked,
        question=question_of(reasons, camera),
        estimates=raw,
        etag=f'"{hashlib.sha256(repr(served).encode()).hexdigest()[:24]}"',
    )


def pose_history(
    session: Session,
    camera_id: str,
    start: datetime | None,
    end: datetime | None,
    *,
    newest: int,
    thinned: int | None,
) -> Sequence[EstimateRecord]:
    """The estimates between two times, oldest first: the newest so many of them.

    Or at most so many of all of them, evenly thinned out.

    Raises:
        NotFoundError: there is no such camera.
    """
    require_camera(session, camera_id)
    if thinned is None:
        return estimates.between(session, camera_id, start, end, newest)
    return estimates.thinned(session, camera_id, start, end, thinned)


def _reasons_of(
    session: Session,
    settings: Settings,
    status: CameraStatus,
    learned: ReferenceView,
    proposed: Proposal | None,
) -> Reasons:
    """Reasons of a camera's state: what is missing, what was told, who is there."""
    now = datetime.now(UTC)
    found: list[Reason] = []
    if status.attended.under_way(now):
        window = references.maintenance_under_way(session, status.camera_id, now)
        if window is not None:
            found.append(_window(window))
    estimate = status.estimate
    if status.judged and estimate is not None and status.state != PoseState.NO_DATA:
        found += estimate.reasons
    elif status.state == PoseState.DRIFTING:
        if estimate is not None and estimate.identifiable:
            found += [Reason(code=ServiceCode.LAST_IDENTIFIABLE), *estimate.reasons]
        else:
            found += _of_alerts(status)
    if status.in_question:
        found += status.reference.doubts
    if status.state == PoseState.UNCALIBRATED:
        found.append(_why_uncalibrated(status, learned, proposed))
    elif not status.judged:
        found += _missing(session, settings, status, learned)
    silence = data_gap_of(session, settings, status.camera_id, now) if status.silent else None
    if silence is not None and status.state in (PoseState.NO_DATA, PoseState.DRIFTING):
        found += silence.reasons
    return tuple(found)


def _of_alerts(status: CameraStatus) -> list[Reason]:
    """The alerts' reasons; once, where several say the same."""
    different: list[Reasons] = []
    for alert in status.alerts:
        if alert.reasons not in different:
            different.append(alert.reasons)
    return [reason for reasons in different for reason in reasons]


def _why_uncalibrated(
    status: CameraStatus, learned: ReferenceView, proposed: Proposal | None
) -> Reason:
    """The reason why the camera has no prior pose: too few tracks, or not yet confirmed."""
    if proposed is None:
        seen = {"tracks": learned.tracks, "least_walkers": FEWEST_WALKERS}
        return Reason(code=ServiceCode.POSE_UNKNOWN, values=seen)
    people: dict[str, Value] = {"tracks": proposed.tracks, "groups": proposed.walking_groups}
    code = ServiceCode.POSE_PROPOSED if proposed.told else ServiceCode.POSE_UNTOLD
    tilt, roll, height = (proposed.sd[name] for name in ("tilt_rad", "roll_rad", "height_m"))
    sd = {"tilt_sd_rad": tilt, "roll_sd_rad": roll, "height_sd_m": height}
    return Reason(code=code, values=people | sd)


def _missing(
    session: Session, settings: Settings, status: CameraStatus, learned: ReferenceView
) -> list[Reason]:
    """The count of people or tracks that is missing until the camera is judged anew."""
    reference = status.reference
    if status.state == PoseState.UNCONNECTED:
        return [Reason(code=ServiceCode.NOBODY_POSTED)]
    if reference.source is None:
        return [Reason(code=ServiceCode.AWAITING_IMAGE, values={"compared": status.images})]
    if reference.ready_at is None:
        wanted = wanted_tracks(reference, settings)
        counts = {"counted": learned.counted, "tracks": learned.tracks, "pieces": learned.pieces}
        values = counts | {"wanted": wanted}
        return [Reason(code=ServiceCode.REFERENCE_TRACKS, values=values)]
    bounds = window_beside(status.attended, reference, settings)
    since: dict[str, Value] = {
        "tracks": windows.count_window(session, bounds),
        "cause": status.cause,
        "least_walkers": FEWEST_WALKERS,
    }
    return [Reason(code=ServiceCode.TRACKS_SINCE, values=since), *reference.doubts]


def _window(window: MaintenanceRecord) -> Reason:
    values = {"until": json_time(window.to_at)}
    if window.reason:
        values["note"] = window.reason
    return Reason(code=ServiceCode.MAINTENANCE, values=values)
