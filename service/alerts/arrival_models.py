"""Learn when a camera usually sees people, and how late its tracks come."""

import math
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from functools import lru_cache
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.durations import DAY_S, HOUR_S
from models.monitoring.arrivals import ArrivalProcess, delay_of, learn_arrivals
from service.enums import AlertKind, Outcome
from service.settings import Settings
from service.store import alerts, cameras, tracks
from service.store.cameras import CameraRecord, RhythmRecord

_PAST_DAYS = 28
_NOT_AGAIN_WITHIN = timedelta(minutes=50)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrivalModel:
    """Arrivals of a usual week, and how late its tracks come at the most, in seconds."""

    rhythm: ArrivalProcess
    delay_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HourCounts:
    """Tracks of each hour, and how late the latest of each day came, in seconds.

    Hours and days are whole ones since the epoch. Both outlive the tracks.
    """

    tracks: dict[int, int]
    latest_s: dict[int, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrivals:
    """The data of an arrival model: when tracks were stored and had ended, and earlier counts.

    `outages` are times, from and to, in which nothing was seen though people came.
    """

    received_s: tuple[float, ...]
    ended_s: tuple[float, ...]
    known: HourCounts
    outages: tuple[tuple[float, float], ...]


def load_arrivals(session: Session, camera_id: str, now: datetime) -> Arrivals | None:
    """The data of a camera's arrival model; None where it was learned within the hour."""
    kept = session.get(RhythmRecord, camera_id)
    if session.get(CameraRecord, camera_id) is None:
        return None
    if kept is not None and abs(now - kept.learned_at) < _NOT_AGAIN_WITHIN:
        return None
    rows = tracks.arrivals(session, camera_id, now - timedelta(days=_PAST_DAYS))
    outages = [
        ((record.changed_at or record.opened_at).timestamp(), record.resolved_at.timestamp())
        for record in alerts.ended(session, camera_id, (AlertKind.NO_DATA,))
        if record.resolved_at is not None and record.outcome != Outcome.FALSE_ALARM
    ]
    return Arrivals(
        received_s=tuple(received_at.timestamp() for received_at, _ in rows),
        ended_s=tuple(ended_s for _, ended_s in rows),
        known=_counts(None if kept is None else kept.counts),
        outages=tuple(outages),
    )


def compute_arrival_model(
    arrivals: Arrivals, settings: Settings, now: datetime
) -> tuple[ArrivalModel | None, HourCounts]:
    """The arrival model and the counts of its hours; no model where too few days have been seen."""
    known = _counted(arrivals, now)
    counts = known.tracks
    # Hours are whole between the first that was counted and the newest track.
    first, last = min(counts, default=0) + 1, max(counts, default=0)
    if min(len(known.latest_s), (last - first) // 24) < settings.rhythm_days:
        return None, known
    seen = np.array([counts.get(hour, 0) for hour in range(first, last)], dtype=float)
    watched = np.ones(len(seen), dtype=bool)
    for from_s, to_s in arrivals.outages:
        begin, end = (math.floor(at_s / HOUR_S) - first for at_s in (from_s, to_s))
        watched[max(begin, 0) : max(end + 1, 0)] = False
    if watched.sum() < 24 * settings.rhythm_days:
        return None, known
    cells = cells_of(first, len(seen), settings.zone)
    rhythm = learn_arrivals(seen, cells, watched, first, np.sort(np.array(arrivals.ended_s)))
    delay_s = delay_of(np.array(list(known.latest_s.values())))
    return ArrivalModel(rhythm=rhythm, delay_s=delay_s), known


def _counted(arrivals: Arrivals, now: datetime) -> HourCounts:
    """Earlier counts and those of what is stored now: an hour had the most that it ever had.

    Tracks come late and are deleted early.
    """
    now_s = now.timestamp()
    oldest = math.floor(now_s / HOUR_S) - _PAST_DAYS * 24 + 1
    counts = {hour: n for hour, n in arrivals.known.tracks.items() if hour >= oldest}
    ended_s, received_s = np.array(arrivals.ended_s), np.array(arrivals.received_s)
    # What was recorded long ago and posted now came late by years; nobody waits for that.
    recent = ended_s >= oldest * HOUR_S
    ended_s, received_s = ended_s[recent], received_s[recent]
    hours, numbers = np.unique((ended_s // HOUR_S).astype(int), return_counts=True)
    for hour, number in zip(hours.tolist(), numbers.tolist(), strict=True):
        if oldest <= hour <= now_s / HOUR_S + 24:
            counts[hour] = max(counts.get(hour, 0), number)
    latest_s = {day: lag for day, lag in arrivals.known.latest_s.items() if 24 * day >= oldest}
    received_days = (received_s // DAY_S).astype(int)
    for day in np.unique(received_days).tolist():
        lag_s = float((received_s - ended_s)[received_days == day].max())
        latest_s[day] = max(latest_s.get(day, -math.inf), lag_s)
    return HourCounts(tracks=counts, latest_s=latest_s)


def save_arrival_model(
    session: Session,
    camera_id: str,
    learned: ArrivalModel | None,
    counts: HourCounts,
    now: datetime,
) -> None:
    """Store an arrival model, unless its camera is gone."""
    if session.get(CameraRecord, camera_id) is not None:
        profile = None if learned is None else asdict(learned.rhythm)
        session.merge(
            RhythmRecord(
                camera_id=camera_id,
                usual_gap_s=None if profile is None else profile.pop("usual_gap_s"),
                delay_s=None if learned is None else learned.delay_s,
                profile=profile,
                counts=asdict(counts),
                learned_at=now,
            )
        )


def arrival_model_of(session: Session, camera_id: str) -> ArrivalModel | None:
    """The arrival model of a camera; None where too little of it is known."""
    kept = cameras.arrival_profile(session, camera_id)
    if kept is None:
        return None
    numbers = {**kept.profile, "rates": tuple(kept.profile["rates"])}
    rhythm = ArrivalProcess(**numbers, usual_gap_s=kept.usual_gap_s)
    return ArrivalModel(rhythm=rhythm, delay_s=kept.delay_s)


def cells_of(first_hour: int, count: int, zone: tzinfo) -> np.ndarray:
    """The cells of a week's profile for hours in a row, by the cameras' own clock (count,)."""
    return np.array([_cell(first_hour + n, zone) for n in range(count)], dtype=int)


@lru_cache(maxsize=4096)
def _cell(hour: int, zone: tzinfo) -> int:
    local = datetime.fromtimestamp(hour * HOUR_S, UTC).astimezone(zone)
    return local.hour + (24 if local.weekday() >= 5 else 0)


def _counts(stored: dict[str, Any] | None) -> HourCounts:
    if stored is None:
        return HourCounts(tracks={}, latest_s={})
    return HourCounts(
        tracks={int(hour): number for hour, number in stored["tracks"].items()},
        latest_s={int(day): lag_s for day, lag_s in stored["latest_s"].items()},
    )
