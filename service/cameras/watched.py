"""Whose page somebody looks at: a camera that is watched is looked at before others."""

import threading
import time

_LATELY_S = 600.0


class Watched:
    """Cameras whose page was asked for lately, of this process alone; for many threads."""

    def __init__(self) -> None:
        self._asked_s: dict[str, float] = {}
        self._lock = threading.Lock()

    def note(self, camera_id: str) -> None:
        """Note that somebody looks at a camera's page."""
        now_s = time.monotonic()
        with self._lock:
            self._asked_s = {
                known: at_s for known, at_s in self._asked_s.items() if now_s - at_s < _LATELY_S
            }
            self._asked_s[camera_id] = now_s

    def __contains__(self, camera_id: str) -> bool:
        asked_s = self._asked_s.get(camera_id)
        return asked_s is not None and time.monotonic() - asked_s < _LATELY_S
