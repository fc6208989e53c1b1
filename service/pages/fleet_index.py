"""All cameras of the fleet in a few numbers each: what its page sifts, sorts and counts by."""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.orm import Session

from service.cameras.status import CameraStatus, camera_statuses, waits
from service.cameras.undo import UNDO_WITHIN
from service.enums import AlertKind, Origin, PoseState, Severity
from service.pages.bulk import kinds_of
from service.settings import Settings
from service.store import fleet
from service.store.fleet import Label
from service.store.references import SiteReferenceRecord
from service.wording.camera import STATES, shown_as
from service.wording.language import _
from service.wording.times import from_seconds

# How soon a camera without an alert needs a person.
_RANKS = {
    PoseState.DRIFTING: 2,
    PoseState.UNSURE: 3,
    PoseState.SUSPECTED: 5,
    PoseState.NO_DATA: 4,
    PoseState.UNCALIBRATED: 6,
    PoseState.UNCONNECTED: 7,
    PoseState.LEARNING: 8,
    PoseState.OK: 9,
}
_CALM = 6  # from this rank on it does not matter since when
_BY_ANSWERS = (Origin.ACCEPTED, Origin.RESET, Origin.PUT_BACK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A camera of the index: its `rank` is 0 where it needs a person at once, 9 not at all.

    `waiting` are its alerts that nobody has taken up. It is `fresh` where an answer may be young
    enough to be undone. `words` is what else it is found by: its source of tracks, who has seen its
    alerts. `kinds` say what can be done with it (bulk.py).
    """

    id: str
    label: Label
    shown: PoseState | AlertKind
    rank: int
    waiting: int
    fresh: bool
    since_s: int
    last_s: int | None
    words: str
    kinds: str

    @property
    def order(self) -> tuple[int, str, int, str, str]:
        """Sorts first what a person should look at first; of one kind the newest, then by name.

        Of one rank kinds stand together, moves first: what is alike is answered at once.
        """
        calm = self.rank >= _CALM
        kind = "" if calm or self.shown == PoseState.DRIFTING else str(self.shown)
        since_s = 0 if calm else self.since_s
        return self.rank, kind, -since_s, sortable(self.label.name), self.id

    def line(self, place: str | int) -> tuple[str | int | None, ...]:
        """As the page's script reads it (fleet.js), with its place, or the number of that."""
        return (
            *(self.id, self.label.name, self.shown, self.rank, self.waiting, self.since_s),
            *(int(self.fresh), self.last_s, self.words, self.kinds, place),
        )

    def fits(
        self, states: Collection[str], words: Collection[str], site: str, tags: Iterable[str]
    ) -> bool:
        """True of one of some states and of a site, if any are named, with all words and tags."""
        own = self.label
        return (
            (not states or self.shown in states)
            and (not site or own.site == site or own.site.startswith(f"{site}/"))
            and set(tags) <= set(own.tags)
            and (not words or self._has(words))
        )

    def _has(self, words: Collection[str]) -> bool:
        state, own = _(STATES[self.shown]), self.label
        text = f"{own.name} {self.id} {state} {self.words} {own.place}".casefold()
        return all(word in text for word in words)


def sortable(name: str) -> str:
    """A name as it is sorted by, here and by the page's script: gate 2 comes before gate 10."""
    return re.sub("[0-9]+", lambda digits: digits[0].zfill(9), name.casefold())


def index_document(entries: Sequence[Entry]) -> dict[str, Any]:
    """The lines of all, with each place once: they name it by its number."""
    numbers: dict[str, int] = {}
    lines = [each.line(numbers.setdefault(each.label.place, len(numbers))) for each in entries]
    return {"places": list(numbers), "cameras": lines}


def entry_of(status: CameraStatus, label: Label, now: datetime) -> Entry:
    """The entry of a camera."""
    seen_by = [each.acknowledged_by for each in status.alerts if each.acknowledged_by is not None]
    source, said_at = status.reference.source, _said_at(status.reference)
    return Entry(
        id=status.camera_id,
        label=label,
        shown=shown_as(status.state, status.alerts),
        rank=_rank(status, now),
        waiting=sum(waits(alert, now) for alert in status.alerts),
        fresh=said_at is not None and now - said_at < UNDO_WITHIN,
        since_s=int(status.since.timestamp()),
        last_s=None if status.last_track_s is None else int(status.last_track_s),
        words=" ".join([*([source] if source else []), *seen_by]),
        kinds=kinds_of(status.alerts),
    )


def fleet_index(session: Session, settings: Settings) -> list[Entry]:
    """All cameras, those first that need a person."""
    now = datetime.now(UTC)
    labels = fleet.labels(session, None)
    statuses = camera_statuses(session, settings, lean=True)
    entries = [entry_of(each, labels[i], now) for i, each in statuses.items() if i in labels]
    return sorted(entries, key=lambda entry: entry.order)


def attended_until(status: CameraStatus, now: datetime) -> datetime | None:
    """The end of the maintenance that is under way."""
    if not status.attended.spans:
        return None  # nearly all of a fleet's cameras
    now_s = now.timestamp()
    ends = (to_s for from_s, to_s in status.attended.spans if from_s <= now_s < to_s)
    return next((from_seconds(to_s) for to_s in ends), None)


def _said_at(reference: SiteReferenceRecord) -> datetime | None:
    """When somebody last answered what the camera showed, of which its reference knows."""
    begun_at = reference.created_at if reference.origin in _BY_ANSWERS else None
    return max((at for at in (reference.answered_at, begun_at) if at is not None), default=None)


def _rank(status: CameraStatus, now: datetime) -> int:
    if attended_until(status, now) is not None:
        return 5
    if not status.alerts:
        return _RANKS[status.state]
    first = status.alerts[0]
    if not waits(first, now):
        return 5 if first.is_silenced(now) else 3
    return 0 if first.severity == Severity.CRITICAL else 1
