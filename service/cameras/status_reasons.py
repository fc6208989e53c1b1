"""Why a camera's state is what it is."""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.reasons import Reason, Value
from models.walking.reference.assumed import FEWEST_WALKERS
from service.alerts.presence import silence_of
from service.cameras.status import CameraStatus
from service.enums import PoseState
from service.notifications.outbox import json_time
from service.reasons import Reasons, ServiceCode
from service.settings import Settings
from service.store import maintenance, windows
from service.store.maintenance import MaintenanceRecord
from service.windows.references import wanted_tracks, window_beside


def reasons_of(session: Session, settings: Settings, status: CameraStatus, so_far: int) -> Reasons:
    """Why a camera's state is what it is: what is missing, what was told, who is there.

    `so_far` is how many tracks its reference has.
    """
    now = datetime.now(UTC)
    found: list[Reason] = []
    if status.attended.under_way(now):
        window = maintenance.under_way(session, status.camera_id, now)
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
    if not status.judged:
        found += _missing(session, settings, status, so_far)
    silence = silence_of(session, settings, status.camera_id, now) if status.silent else None
    if silence is not None and status.state in (PoseState.NO_DATA, PoseState.DRIFTING):
        found += silence.reasons
    return tuple(found)


def _of_alerts(status: CameraStatus) -> list[Reason]:
    """What the alerts say; once, where several say the same."""
    different: list[Reasons] = []
    for alert in status.alerts:
        if alert.reasons not in different:
            different.append(alert.reasons)
    return [reason for reasons in different for reason in reasons]


def _missing(
    session: Session, settings: Settings, status: CameraStatus, so_far: int
) -> list[Reason]:
    """How much is missing until the camera is judged anew."""
    reference = status.reference
    if reference.ready_at is None:
        values = {"tracks": so_far, "wanted": wanted_tracks(reference, settings)}
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
