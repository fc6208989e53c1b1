"""A process's memory of the cameras that are posted to and looked at."""

import threading
import time
from dataclasses import dataclass

from sqlalchemy import Connection

from service.cameras.cameras import no_camera
from service.errors import QuotaError
from service.formats.track import Batch
from service.settings import Settings
from service.store import cameras, tracks
from service.store.cameras import Picture
from service.store.engines.store import Store

_MOST_PICTURES = 10_000
_BEYOND = 1.5  # times `keep_mb` that may lie there until the next retention
_RECOUNT_S = 5.0
_COME_BACK_S = 600.0
_LATELY_S = 600.0


class StalePictureError(Exception):
    """Tracks were read by the picture of a camera that has been changed since."""


class Pictures:
    """Pictures as a process knows them. Who writes compares them with what is there by then."""

    def __init__(self) -> None:
        self._known: dict[str, Picture] = {}

    def of(self, store: Store, camera_id: str) -> Picture:
        """The picture of a camera as it was when it was last asked for.

        Raises:
            NotFoundError: there was no such camera.
        """
        return self._known.get(camera_id) or self.again(store, camera_id)

    def again(self, store: Store, camera_id: str) -> Picture:
        """The picture of a camera as it is.

        Raises:
            NotFoundError: there is no such camera.
        """
        with store.look() as connection:
            found = cameras.awaited(connection, camera_id)
        if found is None:
            self._known.pop(camera_id, None)
            raise no_camera(camera_id)
        if len(self._known) >= _MOST_PICTURES:
            self._known.clear()
        self._known[camera_id] = found.picture
        return found.picture


def check_picture(connection: Connection, camera_id: str, read_by: Picture) -> cameras.Awaited:
    """The uses that await a camera's tracks, if its picture is the one they were read by.

    Raises:
        NotFoundError: there is no such camera.
        StalePictureError: the picture is another by now.
    """
    awaited = cameras.awaited(connection, camera_id)
    if awaited is None:
        raise no_camera(camera_id)
    if awaited.picture != read_by:
        raise StalePictureError(camera_id)
    return awaited


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
