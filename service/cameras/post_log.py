"""The newest posts of each camera's tracks: what was taken, and what was refused and why.

In this process's memory alone, since nobody needs it after the tracker works: it is gone with the
process, and each process knows what was posted to it.
"""

import logging
import threading
from collections import Counter, deque
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from datetime import UTC, datetime

from service.cameras.tracks import Receipt
from service.errors import NothingTakenError, ServiceError
from surefoot.people import SkipReason

log = logging.getLogger("surefoot.tracks")

_MOST_CAMERAS = 1_000  # of 20 refusals each: 15 MB at most
_MOST_REFUSALS = 20
_MOST_LETTERS = 300


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """A track that was refused, or a whole post: `what` is the track's id or place."""

    at: datetime
    what: str
    code: str
    detail: str


@dataclass(slots=True, kw_only=True)
class Posts:
    """Counts of the tracks posted for one camera: accepted, known, rejected and skipped ones."""

    last_at: datetime | None = None
    accepted: int = 0
    duplicates: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    skipped: Counter[SkipReason] = field(default_factory=Counter)
    newest: deque[Refusal] = field(default_factory=lambda: deque(maxlen=_MOST_REFUSALS))


class PostLog:
    """The posts since this process began, of so many cameras that were posted to last."""

    def __init__(self) -> None:
        self.since = datetime.now(UTC)
        self._posts: dict[str, Posts] = {}
        self._logged: set[tuple[str, str, SkipReason]] = set()
        self._lock = threading.Lock()

    def of(self, camera_id: str) -> Posts:
        """The posts of a camera, as they are now."""
        with self._lock:
            return deepcopy(self._posts.get(camera_id) or Posts())

    def forget(self, camera_id: str) -> None:
        """Forget a camera that is gone."""
        with self._lock:
            self._posts.pop(camera_id, None)

    def note(self, camera_id: str, receipt: Receipt) -> None:
        """Note a post that was answered; log each new reason to skip tracks of a source."""
        refusals = [
            (each.track_id or f"number {each.index + 1}", each.code, each.detail)
            for each in receipt.rejections
        ]
        self._add(camera_id, receipt.accepted, receipt.duplicates, refusals, receipt.skipped)
        for reason, count in receipt.skipped.items():
            self._log_skipped(camera_id, receipt, reason, count)

    def _log_skipped(
        self, camera_id: str, receipt: Receipt, reason: SkipReason, count: int
    ) -> None:
        key = (camera_id, receipt.source, reason)
        with self._lock:
            if key in self._logged:
                return
            if len(self._logged) >= _MOST_CAMERAS:
                self._logged.clear()
            self._logged.add(key)
        fields = {"camera_id": camera_id, "source": receipt.source, "reason": reason}
        extra = {**fields, "tracks": count, "classes": list(receipt.other_classes)}
        log.info("posted_tracks_skipped", extra=extra)

    def note_error(self, camera_id: str, error: ServiceError) -> None:
        """Note a post that was refused: each of its tracks, or as a whole."""
        reasons = "; ".join(f"{each.pointer} {each.reason}".strip() for each in error.errors[:3])
        refusals = [("the whole post", error.code, reasons or error.detail)]
        skipped: Mapping[SkipReason, int] = {}
        if isinstance(error, NothingTakenError):  # its reasons begin with each track's code
            parts = [(each.pointer, *each.reason.partition(": ")) for each in error.errors]
            refusals = [(pointer, code, detail) for pointer, code, _, detail in parts]
            skipped = error.skipped
        self._add(camera_id, 0, 0, refusals, skipped)

    def _add(
        self,
        camera_id: str,
        accepted: int,
        duplicates: int,
        refusals: list[tuple[str, str, str]],
        skipped: Mapping[SkipReason, int],
    ) -> None:
        now = datetime.now(UTC)
        with self._lock:
            posts = self._posts.pop(camera_id, None) or Posts()
            self._posts[camera_id] = posts  # the last one: the first is the longest silent
            if len(self._posts) > _MOST_CAMERAS:
                del self._posts[next(iter(self._posts))]
            posts.last_at = now
            posts.accepted += accepted
            posts.duplicates += duplicates
            posts.skipped.update(skipped)
            posts.refused.update(code for _, code, _ in refusals)
            posts.newest.extendleft(
                Refusal(at=now, what=what, code=code, detail=detail[:_MOST_LETTERS])
                for what, code, detail in refusals[-_MOST_REFUSALS:]
            )
