"""How many bytes of a camera are stored, between one retention and the next."""

import threading
import time
from dataclasses import dataclass

from service.errors import QuotaError
from service.formats.track import Batch
from service.settings import Settings
from service.store import tracks
from service.store.engines.store import Store

_BEYOND = 1.5  # times `keep_mb` that may lie there until the next retention
_RECOUNT_S = 5.0
_COME_BACK_S = 600.0


@dataclass(slots=True, kw_only=True)
class _Count:
    stored: int
    at_s: float


class Quota:
    """Counts what is posted on top of what was stored; counts anew when that is too much.

    What is posted twice is counted twice until then.
    """

    def __init__(self, settings: Settings) -> None:
        self._most = settings.keep_mb * 1e6 * _BEYOND
        self._counts: dict[str, _Count] = {}
        self._lock = threading.Lock()

    def check(self, store: Store, camera_id: str, batch: Batch) -> None:
        """Refuse tracks for which a camera has no room now; the store is asked where that is near.

        Raises:
            QuotaError: well more is stored than retention will leave.
        """
        coming = sum(track.stored_bytes for track in batch.tracks)
        now_s = time.monotonic()
        with self._lock:
            count = self._counts.get(camera_id)
            stale = count is None or (
                count.stored + coming > self._most and now_s - count.at_s > _RECOUNT_S
            )
        if count is None or stale:
            with store.read() as session:
                count = _Count(stored=tracks.stored_bytes(session, camera_id), at_s=now_s)
        with self._lock:
            self._counts[camera_id] = count
            if count.stored + coming > self._most:
                raise QuotaError(
                    f"tracks: {count.stored / 1e6:.1f} MB of this camera are stored; "
                    f"{self._most / _BEYOND / 1e6:g} MB are kept (SUREFOOT_KEEP_MB), and at "
                    f"most {_BEYOND:g} times that until older ones are deleted",
                    retry_after_s=_COME_BACK_S,
                )
            count.stored += coming
