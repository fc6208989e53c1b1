"""Counts of what the bridge has done since it started, for its heartbeat and its log."""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Any

from surefoot.bridge.values import SkippedRow

log = logging.getLogger("surefoot.bridge")

EXTRACT_BYTES = 120  # of a rejected message, in the log and on the page
_LOG_S = 60.0
_MOST_KEYS = 10_000  # of the log's memory: wildcards match whatever others publish
_MOST_UNKNOWN = 50  # names of unknown cameras that are counted by name
_MOST_CAMERAS = 1_000
_FED_S = 86_400.0  # a camera that gets no tracks for longer is not fed by this bridge
_NEWEST = 10  # rejections that are kept whole
OTHERS = "others"


class Tally:
    """Counts and newest rejections, for several threads.

    A reason is logged once a minute for each topic: a wrong profile rejects every frame.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._started_at = datetime.now(UTC)
        self._counts: Counter[str] = Counter()
        self._unknown: Counter[str] = Counter()
        self._cameras: dict[str, float] = {}  # when they were posted to last, the newest last
        self._newest: deque[dict[str, Any]] = deque(maxlen=_NEWEST)
        self._logged_s: dict[tuple[str, ...], float] = {}

    def count(self, what: str, by: int = 1) -> None:
        """Add to one of the counts."""
        with self._lock:
            self._counts[what] += by

    def posted(self, camera: str, accepted: int) -> None:
        """Count tracks that the service has accepted for a camera."""
        with self._lock:
            self._counts["tracks_posted"] += accepted
            self._cameras.pop(camera, None)
            self._cameras[camera] = self._clock()
            if len(self._cameras) > _MOST_CAMERAS:
                del self._cameras[next(iter(self._cameras))]

    def reject(self, topic: str, code: str, detail: str, payload: bytes) -> None:
        """Count a rejected message, and log why."""
        self._note("messages_rejected", 1, topic, code, detail, payload)

    def skip(self, topic: str, rows: Sequence[SkippedRow], payload: bytes) -> None:
        """Count rows of a message that were skipped, and log why the first was."""
        self._note("rows_skipped", len(rows), topic, *rows[0], payload)

    def set_aside(self, topic: str, crashes: int, payload: bytes) -> None:
        """Count a message that is not read again, and log it."""
        detail = f"the process ended {crashes} times while it handled this message"
        self._note("messages_set_aside", 1, topic, "crashes", detail, payload)

    def unknown(self, camera: str, topic: str) -> None:
        """Count a message for a camera that the service does not have."""
        with self._lock:
            self._counts["messages_unknown_camera"] += 1
            known = camera in self._unknown or len(self._unknown) < _MOST_UNKNOWN
            self._unknown[camera if known else OTHERS] += 1
        if self._may_log("camera_unknown", "", camera if known else OTHERS):
            log.warning("camera_unknown", extra={"camera_id": camera, "topic": topic[:200]})

    def report(self) -> dict[str, Any]:
        """The counts as the heartbeat sends them."""
        since_s = self._clock() - _FED_S
        with self._lock:
            return {
                "started_at": self._started_at.isoformat(),
                "counts": dict(self._counts),
                "unknown_cameras": dict(self._unknown),
                "cameras": [name for name, at_s in self._cameras.items() if at_s > since_s],
                "newest_rejections": list(self._newest),
            }

    def _note(
        self, event: str, by: int, topic: str, code: str, detail: str, payload: bytes
    ) -> None:
        extract = payload[:EXTRACT_BYTES].decode("utf-8", "backslashreplace")
        found = {"topic": topic[:200], "code": code, "detail": detail, "extract": extract}
        with self._lock:
            self._counts[event] += by
            self._newest.append({"at": datetime.now(UTC).isoformat(), "event": event, **found})
        if self._may_log(event, topic, code):
            log.warning(event, extra=found)

    def _may_log(self, *key: str) -> bool:
        now_s = self._clock()
        with self._lock:
            if now_s - self._logged_s.get(key, -_LOG_S) < _LOG_S:
                return False
            if len(self._logged_s) >= _MOST_KEYS:
                self._logged_s.clear()
            self._logged_s[key] = now_s
            return True
