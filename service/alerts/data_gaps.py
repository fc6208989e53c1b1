"""Data gaps: how long a camera has been silent, and whether that is usual."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from models.durations import HOUR_S
from models.monitoring.arrivals import (
    SilenceRule,
    SilenceVerdict,
    expected_tracks,
    is_missed,
    judge_silence,
)
from models.reasons import Reason
from service.alerts.alerts import end_alert, open_alert
from service.alerts.arrival_models import ArrivalModel, arrival_model_of, cells_of
from service.enums import AlertKind, AlertSource, Outcome, Severity
from service.reasons import Reasons, ServiceCode
from service.references import attendance_of
from service.settings import Settings
from service.store import alerts, tracks
from service.wording.alerts import TRACKS_COME_AGAIN

_LOOK_BACK_S = 3 * HOUR_S  # the level of the day is told by these hours before a silence
_LONGEST_S = 28 * 24 * HOUR_S
_GAPS = 3.0  # so many usual gaps in a row are no usual one
_STATE_BY_S = 6 * HOUR_S  # a pose that nobody has confirmed for longer is not ok, however quiet
_SEVERITIES = {
    SilenceVerdict.USUAL: None,
    SilenceVerdict.IMPROBABLE: Severity.WARNING,
    SilenceVerdict.TOO_LONG: Severity.CRITICAL,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DataGap:
    """The time since a camera's newest track, whether that is `no_data`, and why.

    `severity` is that of the alert that it deserves; None where silence is usual by now.
    """

    last_s: float
    no_data: bool
    reasons: Reasons
    severity: Severity | None


def data_gap_of(
    session: Session, settings: Settings, camera_id: str, now: datetime
) -> DataGap | None:
    """The silence of a camera; None where it has never seen anybody, or just has."""
    last_s = tracks.newest_end_s(session, camera_id)
    if last_s is None or now.timestamp() - last_s < settings.no_data_min_s:
        return None
    known = arrival_model_of(session, camera_id)
    if known is None:
        return _by_the_limit(session, settings, camera_id, last_s, now)
    return _by_arrivals(session, settings, camera_id, known, last_s, now)


def is_no_data(
    settings: Settings,
    last_s: float | None,
    now: datetime,
    usual_gap_s: float | None = None,
    delay_s: float | None = None,
) -> bool:
    """True where a camera whose newest track ended then has been silent for too long to be ok.

    A usual gap, and how late tracks come at the most, are of its arrival model, if it has one.
    """
    if last_s is None or now.timestamp() - last_s < settings.no_data_min_s:
        return False
    limit_s = settings.no_data_after_h * HOUR_S
    if usual_gap_s is None or delay_s is None:
        return now.timestamp() - last_s > limit_s
    gap_s = max(_GAPS * usual_gap_s, settings.no_data_min_s)
    return now.timestamp() - delay_s - last_s > min(gap_s, _STATE_BY_S, limit_s)


def watch_data_gap(
    session: Session, settings: Settings, camera_id: str, now: datetime
) -> str | None:
    """Open or end the alert about a silent camera; says what it did."""
    firing = alerts.firing(session, camera_id, AlertKind.NO_DATA)
    if firing is not None:
        received_at = tracks.newest_received_at(session, camera_id)
        if received_at is not None and received_at > firing.opened_at:
            end_alert(
                session, camera_id, AlertKind.NO_DATA, Outcome.CLEARED, note=TRACKS_COME_AGAIN
            )
            return TRACKS_COME_AGAIN
    silence = data_gap_of(session, settings, camera_id, now)
    if silence is None or silence.severity is None:
        return None
    if firing is not None and silence.severity in (firing.severity, Severity.WARNING):
        return None
    opened = open_alert(
        session,
        settings,
        camera_id,
        AlertKind.NO_DATA,
        silence.severity,
        {},
        datetime.fromtimestamp(silence.last_s, UTC),
        reasons=silence.reasons,
        source=AlertSource.RHYTHM,
    )
    return None if opened is None else "no tracks come"


def _by_the_limit(
    session: Session, settings: Settings, camera_id: str, last_s: float, now: datetime
) -> DataGap:
    """By the fixed limit alone: too little is known of the camera."""
    limit_s = settings.no_data_after_h * HOUR_S
    silent_s = now.timestamp() - last_s
    severity = None
    if silent_s > limit_s:  # at night, hundreds of cameras need no closer look
        # What was recorded long ago and posted just now is old, but not a camera that fell silent.
        begun_s = max(_received_s(session, camera_id), _answered_s(session, camera_id, now))
        severity = Severity.WARNING if now.timestamp() - begun_s > limit_s else None
    return DataGap(
        last_s=last_s,
        no_data=is_no_data(settings, last_s, now),
        reasons=(
            Reason(
                code=ServiceCode.SILENT_UNKNOWN,
                values={"silent_s": silent_s, "limit_s": limit_s},
            ),
        ),
        severity=severity,
    )


def _by_arrivals(
    session: Session,
    settings: Settings,
    camera_id: str,
    known: ArrivalModel,
    last_s: float,
    now: datetime,
) -> DataGap:
    now_s, rhythm = now.timestamp(), known.rhythm
    # Tracks of later may be on their way.
    until_s = now_s - known.delay_s
    limit_s = settings.no_data_after_h * HOUR_S
    from_s = max(last_s, until_s - _LONGEST_S)
    missed, verdict = _expected(settings, known, from_s, until_s), SilenceVerdict.USUAL
    if is_missed(rhythm, missed):  # as above
        from_s = max(from_s, _answered_s(session, camera_id, now))
        verdict = judge_silence(
            rhythm,
            SilenceRule(
                false_per_year=settings.false_no_data_per_year,
                least_s=settings.no_data_min_s,
                limit_s=limit_s,
            ),
            missed=_expected(settings, known, from_s, until_s),
            # Tracks that come now are a sign of life, of whenever they are.
            silent_s=min(until_s - from_s, now_s - _received_s(session, camera_id)),
            seen=tracks.count_ended(session, camera_id, last_s - _LOOK_BACK_S, last_s),
            expected=_expected(settings, known, last_s - _LOOK_BACK_S, last_s),
        )
    code, values = ServiceCode.SILENT_USUAL, {"silent_s": now_s - last_s}
    if is_missed(rhythm, missed):
        code, values["missed_tracks"] = ServiceCode.SILENT_UNUSUAL, missed
    if known.delay_s > settings.no_data_min_s:
        values["late_s"] = known.delay_s
    return DataGap(
        last_s=last_s,
        no_data=is_no_data(settings, last_s, now, rhythm.usual_gap_s, known.delay_s),
        reasons=(Reason(code=code, values=values),),
        severity=_SEVERITIES[verdict],
    )


def _expected(settings: Settings, known: ArrivalModel, from_s: float, to_s: float) -> float:
    first = math.floor(from_s / HOUR_S)
    hours = max(math.floor(to_s / HOUR_S) - first + 1, 0)
    cells = cells_of(first, hours, settings.zone)
    return expected_tracks(known.rhythm, cells, first, from_s, to_s)


def _answered_s(session: Session, camera_id: str, now: datetime) -> float:
    """The time until which a silence is explained: by maintenance, or by who ended its alert."""
    attended_s = attendance_of(session, camera_id, now).judged_from_s or 0.0
    last = alerts.newest(session, camera_id, AlertKind.NO_DATA)
    if last is None or last.resolved_at is None:
        return attended_s
    return max(attended_s, last.resolved_at.timestamp())


def _received_s(session: Session, camera_id: str) -> float:
    received_at = tracks.newest_received_at(session, camera_id)
    return 0.0 if received_at is None else received_at.timestamp()
