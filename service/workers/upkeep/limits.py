"""What may be forgotten: each limit deletes a bite at a time, in a transaction of its own."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from sqlalchemy.orm import Session

from service.settings import Settings
from service.store import (
    activity,
    alerts,
    cameras,
    estimates,
    events,
    maintenance,
    references,
    tracks,
    trainings,
    webhooks,
)

BITE = 500  # rows: posts wait for the write lock no longer than these take
_KEPT_MODELS = 2
_WRITTEN_WITHIN_S = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A limit on what is kept. `bite` deletes up to `BITE` rows, oldest first; how many it was."""

    name: str
    bite: Callable[[Session], int]


def limits_of_camera(settings: Settings, camera_id: str) -> Iterator[Limit]:
    """The limits on what is kept of a camera."""
    now = datetime.now(UTC)
    before = now - timedelta(days=settings.keep_days)
    most_bytes = round(settings.keep_mb * 2**20)
    yield Limit(
        name="tracks",
        bite=lambda session: tracks.forget(session, camera_id, before, settings.keep_tracks, BITE),
    )
    if most_bytes:
        yield Limit(
            name="tracks_by_size",
            bite=lambda session: tracks.forget_tracks(session, camera_id, most_bytes, BITE),
        )
    yield Limit(
        name="maintenance_windows",
        bite=lambda session: maintenance.forget(session, camera_id, before, BITE),
    )
    yield Limit(
        name="estimates",
        bite=lambda session: estimates.forget(session, camera_id, settings.keep_estimates, BITE),
    )
    yield Limit(name="models", bite=lambda session: _forget_models(session, camera_id))
    yield Limit(
        name="trainings",
        bite=lambda session: trainings.forget(session, camera_id, settings.keep_trainings, BITE),
    )
    yield Limit(
        name="references",
        bite=lambda session: references.forget(session, camera_id, settings.keep_references, BITE),
    )
    yield Limit(
        name="prior_poses",
        bite=lambda session: cameras.forget_poses(
            session, camera_id, settings.keep_references, BITE
        ),
    )


def limits_of_all(settings: Settings) -> Iterator[Limit]:
    """The limits on what is kept of all cameras together, and of webhooks."""
    now = datetime.now(UTC)
    patience = now - timedelta(hours=settings.webhook_patience_h)
    ended = now - timedelta(days=settings.keep_deliveries_days)
    resolved = now - timedelta(days=settings.keep_alerts_days)
    done = now - timedelta(days=settings.keep_activity_days)
    yield Limit(
        name="events", bite=lambda session: events.forget(session, settings.keep_events, BITE)
    )
    yield Limit(name="weights", bite=lambda session: trainings.forget_weights(session, BITE))
    yield Limit(name="alerts", bite=lambda session: alerts.forget(session, resolved, BITE))
    yield Limit(name="activity", bite=lambda session: activity.forget(session, done, BITE))
    yield Limit(
        name="deliveries_given_up",
        bite=lambda session: webhooks.give_up(session, patience, now, BITE),
    )
    yield Limit(name="deliveries", bite=lambda session: webhooks.forget(session, ended, BITE))
    yield Limit(
        name="old_secrets", bite=lambda session: webhooks.forget_old_secrets(session, now, BITE)
    )


def unused_weights(session: Session, folder: Path) -> list[Path]:
    """Weight files that no model names and that are not being written now."""
    used = trainings.weights_in_use(session)
    since = time.time() - _WRITTEN_WITHIN_S
    return [
        path
        for path in folder.glob("*")
        if path.name.split(".")[0] not in used and path.stat().st_mtime < since
    ]


def _forget_models(session: Session, camera_id: str) -> int:
    superseded = trainings.superseded_models(session, camera_id, _KEPT_MODELS)
    for model in superseded[:BITE]:
        session.delete(model)
    return min(len(superseded), BITE)
