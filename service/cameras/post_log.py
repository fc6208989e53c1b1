"""The newest posts of each camera's tracks: what was taken, and what was refused and why.

In this process's memory alone, since nobody needs it after the tracker works: it is gone with the
process, and each process knows what was posted to it.
"""

import threading
from collections import Counter, deque
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from datetime import UTC, datetime

from service.errors import NothingTakenError, ServiceError
from service.formats.track import Rejection

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
    """The posts of one camera: tracks `accepted`, known by then, and refused by their codes."""

    last_at: datetime | None = None
    accepted: int = 0
    duplicates: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    newest: deque[Refusal] = field(default_factory=lambda: deque(maxlen=_MOST_REFUSALS))


class PostLog:
    """The posts since this process began, of so many cameras that were posted to last."""

    def __init__(self) -> None:
        self.since = datetime.now(UTC)
        self._posts: dict[str, Posts] = {}
        self._lock = threading.Lock()

    def of(self, camera_id: str) -> Posts:
        """The posts of a camera, as they are now."""
        with self._lock:
            return deepcopy(self._posts.get(camera_id) or Posts())

    def forget(self, camera_id: str) -> None:
        """Forget a camera that is gone."""
        with self._lock:
            self._posts.pop(camera_id, None)

    def note(
        self, camera_id: str, accepted: int, duplicates: int, rejections: Sequence[Rejection]
    ) -> None:
        """Note a post of which something, or nothing, was to be taken."""
        refusals = [
            (each.track_id or f"number {each.index + 1}", each.code, each.detail)
            for each in rejections
        ]
        self._add(camera_id, accepted, duplicates, refusals)

    def note_error(self, camera_id: str, error: ServiceError) -> None:
        """Note a post that was refused: each of its tracks, or as a whole."""
        reasons = "; ".join(f"{each.pointer} {each.reason}".strip() for each in error.errors[:3])
        refusals = [("the whole post", error.code, reasons or error.detail)]
        if isinstance(error, NothingTakenError):  # its reasons begin with each track's code
            parts = [(each.pointer, *each.reason.partition(": ")) for each in error.errors]
            refusals = [(pointer, code, detail) for pointer, code, _, detail in parts]
        self._add(camera_id, 0, 0, refusals)

    def _add(
        self, camera_id: str, accepted: int, duplicates: int, refusals: list[tuple[str, str, str]]
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
            posts.refused.update(code for _, code, _ in refusals)
            posts.newest.extendleft(
                Refusal(at=now, what=what, code=code, detail=detail[:_MOST_LETTERS])
                for what, code, detail in refusals[-_MOST_REFUSALS:]
            )
