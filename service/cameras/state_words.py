"""Why a camera's state is what it is."""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.reasons import Reason, Value
from models.walking.config import FEWEST_WALKERS
from service.alerts.data_gaps import data_gap_of
from service.cameras.standing import Standing
from service.enums import PoseState
from service.notifications.outbox import json_time
from service.reasons import Reasons, ServiceCode
from service.references import wanted_tracks, window_beside
from service.settings import Settings
from service.store import maintenance, windows
from service.store.maintenance import MaintenanceRecord


def reasons_of(session: Session, settings: Settings, standing: Standing, so_far: int) -> Reasons:
    """Why a camera's state is what it is: what is missing, what was told, who is there.

    `so_far` is how many tracks its reference has.
    """
    now = datetime.now(UTC)
    found: list[Reason] = []
    if standing.attended.under_way(now):
        window = maintenance.under_way(session, standing.camera_id, now)
        if window is not None:
            found.append(_window(window))
    estimate = standing.estimate
    if standing.judged and estimate is not None and standing.state != PoseState.NO_DATA:
        found += estimate.reasons
    elif standing.state == PoseState.DRIFTING:
        if estimate is not None and estimate.identifiable:
            found += [Reason(code=ServiceCode.LAST_IDENTIFIABLE), *estimate.reasons]
        else:
            found += _of_alerts(standing)
    if not standing.judged:
        found += _missing(session, settings, standing, so_far)
    silence = data_gap_of(session, settings, standing.camera_id, now) if standing.silent else None
    if silence is not None and standing.state in (PoseState.NO_DATA, PoseState.DRIFTING):
        found += silence.reasons
    return tuple(found)


def _of_alerts(standing: Standing) -> list[Reason]:
    """What the alerts say; once, where several say the same."""
    different: list[Reasons] = []
    for alert in standing.alerts:
        if alert.reasons not in different:
            different.append(alert.reasons)
    return [reason for reasons in different for reason in reasons]


def _missing(session: Session, settings: Settings, standing: Standing, so_far: int) -> list[Reason]:
    """How much is missing until the camera is judged anew."""
    reference = standing.reference
    if reference.ready_at is None:
        values = {"tracks": so_far, "wanted": wanted_tracks(reference, settings)}
        return [Reason(code=ServiceCode.REFERENCE_TRACKS, values=values)]
    bounds = window_beside(standing.attended, reference, settings)
    since: dict[str, Value] = {
        "tracks": windows.count_window(session, bounds),
        "cause": standing.cause,
        "least_walkers": FEWEST_WALKERS,
    }
    return [Reason(code=ServiceCode.TRACKS_SINCE, values=since), *reference.doubts]


def _window(window: MaintenanceRecord) -> Reason:
    values = {"until": json_time(window.to_at)}
    if window.reason:
        values["note"] = window.reason
    return Reason(code=ServiceCode.MAINTENANCE, values=values)
