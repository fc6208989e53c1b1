"""Why a camera's state is what it is, in words."""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.kinds import Cause, PoseState
from service.recalibration.camera_state import MOVED, Standing
from service.recalibration.presence import silence_of
from service.recalibration.references import (
    FEWEST_WALKERS,
    tracks_so_far,
    wanted_tracks,
    window_beside,
)
from service.settings import Settings
from service.store import maintenance, tracks
from service.store.alert_tables import MaintenanceRecord

_SINCE = {
    Cause.REFERENCE: "since the reference",
    Cause.MAINTENANCE: "since the maintenance",
    Cause.PUT_BACK: "since the camera was put back",
    Cause.FALSE_ALARM: "since the alert was called a false alarm",
}


def reason_of(session: Session, settings: Settings, standing: Standing) -> str:
    """Why a camera's state is what it is: what is missing, what was told, who is there."""
    now = datetime.now(UTC)
    parts = []
    window = maintenance.under_way(session, standing.camera_id, now)
    if window is not None:
        parts.append(_describe_window(window))
    estimate = standing.estimate
    if standing.judged and estimate is not None and standing.state is not PoseState.NO_DATA:
        parts.append(estimate.reason)
    elif standing.state in MOVED:
        if estimate is not None and estimate.told:
            parts.append(f"when it was last told: {estimate.reason}")
        else:
            parts.append("; ".join(dict.fromkeys(alert.reason for alert in standing.alerts)))
    if not standing.judged:
        parts.append(_missing(session, settings, standing))
    silence = silence_of(session, settings, standing.camera_id, now) if standing.silent else None
    if silence is not None and standing.state in (PoseState.NO_DATA, *MOVED):
        parts.append(silence.reason)
    return "; ".join(part for part in parts if part)


def _missing(session: Session, settings: Settings, standing: Standing) -> str:
    """How much is missing until the camera is judged anew."""
    reference = standing.reference
    if reference.ready_at is None:
        so_far = tracks_so_far(session, settings, reference)
        return f"{so_far} of {wanted_tracks(reference, settings)} reference tracks"
    bounds = window_beside(standing.attended, reference, settings)
    since = tracks.count_window(session, bounds)
    text = f"{since} tracks {_SINCE[standing.cause]}; at least {FEWEST_WALKERS} of people who walk"
    text += " for a few seconds inside the image are needed"
    return "; ".join(part for part in (text, reference.doubt) if part)


def _describe_window(window: MaintenanceRecord) -> str:
    until = f"maintenance is under way until {window.to_at:%Y-%m-%d %H:%M}Z"
    return f"{until} ({window.reason})" if window.reason else until
