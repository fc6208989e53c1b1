"""Pictures that the service asks cameras for: each hour, and at once when people raise a doubt."""

import logging
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

from service.cameras.snapshots import put_snapshot
from service.errors import ServiceError
from service.formats.still import read_still
from service.notifications.fetch import FetchError, fetch
from service.store import cameras
from service.store.cameras import CameraRecord
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")

_AT_ONCE = 4  # they wait for cameras most of the time
_AGAIN = timedelta(minutes=10)  # after one that failed


class SnapshotRounds:
    """Fetches what is due in threads of its own: one that does not answer holds up few."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="snapshots")
        self._under_way: set[str] = set()
        self._lock = threading.Lock()

    def run(self, context: JobContext) -> None:
        """Begin to fetch the pictures that are due."""
        if context.settings.snapshots == "off":
            return
        every = timedelta(minutes=context.settings.snapshot_every_min)
        with context.store.read() as session:
            due = cameras.snapshots_due(session, datetime.now(UTC), every, 4 * _AT_ONCE)
        for camera_id, url in due:
            with self._lock:
                if camera_id in self._under_way or len(self._under_way) >= 4 * _AT_ONCE:
                    continue
                self._under_way.add(camera_id)
            self._threads.submit(self._fetch, context, camera_id, url)

    def _fetch(self, context: JobContext, camera_id: str, url: str) -> None:
        try:
            fetch_snapshot(context, camera_id, url)
        except Exception:
            log.exception("snapshot_failed", extra={"camera_id": camera_id})
        finally:
            with self._lock:
                self._under_way.discard(camera_id)


def fetch_snapshot(context: JobContext, camera_id: str, url: str) -> None:
    """Ask a camera for its picture, and have it compared; why none came is kept with the camera."""
    settings, error = context.settings, None
    try:
        found = fetch(settings, url)
        still = read_still(found.content, found.media_type)
        with context.store.write(camera_id) as session:
            put_snapshot(session, context.queue, camera_id, still)
    except (FetchError, ServiceError) as failed:
        error = str(failed)
        fields = {"camera_id": camera_id, "error": error}
        log.warning("snapshot_not_fetched", extra=fields)
    every = timedelta(minutes=settings.snapshot_every_min)
    with context.store.write(camera_id) as session:
        camera = session.get(CameraRecord, camera_id)
        if camera is not None:
            camera.snapshot_error = error
            wait = every if error is None else min(_AGAIN, every)
            camera.snapshot_due_at = datetime.now(UTC) + wait
