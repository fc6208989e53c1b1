"""Images that the service fetches from cameras: each hour, and at once if tracks raise a doubt."""

import logging
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

from models.durations import HOUR_S
from service.addresses import origin_of
from service.cameras.image_source import fetch_image
from service.cameras.snapshots import put_snapshot
from service.errors import ServiceError
from service.formats.still import read_still
from service.notifications.fetch import FetchError
from service.notifications.host_backoff import HostBackoff
from service.store import cameras
from service.store.cameras import CameraRecord, DueImage
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")

_AT_ONCE = 32  # most of their time they wait for cameras
_UNPROVEN = 24  # of them for cameras that sent no image last time, or were never asked
_PER_HOST = 4  # and for one host
_DECODED_AT_ONCE = 2  # each takes a process of up to 1 GiB
_AGAIN = timedelta(minutes=10)  # after a request that failed
_LONGEST_PAUSE_S = HOUR_S / 6  # of a host


class SnapshotRounds:
    """Fetches images that are due, in threads of its own.

    Cameras that do not answer delay the others little: waits are short, a host that did not answer
    is left alone for a while, and some threads are for cameras that answered last time.
    """

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="snapshots")
        self._under_way: dict[str, DueImage] = {}
        self._lock = threading.Lock()
        self.hosts = HostBackoff(_LONGEST_PAUSE_S)
        self.decoding = threading.Semaphore(_DECODED_AT_ONCE)

    def run(self, context: JobContext) -> None:
        """Begin to fetch the images that are due, as far as there is room."""
        if context.settings.snapshots == "off":
            return
        every = timedelta(minutes=context.settings.snapshot_every_min)
        with context.store.read() as session:
            due = cameras.snapshots_due(session, datetime.now(UTC), every)
        for each in due:
            with self._lock:
                if not self._has_room(each):
                    continue
                self._under_way[each.camera_id] = each
            self._threads.submit(self._fetch, context, each.camera_id)

    def _has_room(self, due: DueImage) -> bool:
        busy = self._under_way.values()
        if due.camera_id in self._under_way or len(busy) >= _AT_ONCE:
            return False
        if not due.answers and sum(not each.answers for each in busy) >= _UNPROVEN:
            return False
        host = origin_of(due.url)
        return sum(origin_of(each.url) == host for each in busy) < _PER_HOST

    def _fetch(self, context: JobContext, camera_id: str) -> None:
        try:
            self.fetch(context, camera_id)
        except Exception:
            log.exception("snapshot_failed", extra={"camera_id": camera_id})
        finally:
            with self._lock:
                self._under_way.pop(camera_id, None)

    def fetch(self, context: JobContext, camera_id: str) -> None:
        """Fetch the image of a camera and have it compared, or store why none came."""
        settings, error, again = context.settings, None, None
        every = timedelta(minutes=settings.snapshot_every_min)
        try:
            found = fetch_image(context.store, settings, camera_id, self.hosts)
            with self.decoding:
                still = read_still(found.content, found.media_type)
            with context.store.write(camera_id) as session:
                put_snapshot(session, context.queue, camera_id, still)
        except (FetchError, ServiceError) as failed:
            error, again = str(failed), min(_AGAIN, every)
            if isinstance(failed, FetchError) and failed.retry_after_s is not None:
                again = timedelta(seconds=failed.retry_after_s)
            log.warning("snapshot_not_fetched", extra={"camera_id": camera_id, "error": error})
        with context.store.write(camera_id) as session:
            camera = session.get(CameraRecord, camera_id)
            if camera is not None:
                camera.snapshot_error = error
                camera.snapshot_due_at = datetime.now(UTC) + (again or every)
