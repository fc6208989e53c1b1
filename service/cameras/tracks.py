"""Take in tracks; and a process's memory of the cameras that are posted to and looked at."""

import math
import threading
import time
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection

from service.access.claims import require_claim
from service.access.tokens import Caller
from service.cameras.cameras import no_camera
from service.cameras.sources import note_source
from service.errors import FieldError, NothingTakenError, QuotaError
from service.estimate_queue import request_estimate
from service.formats.track import Batch, Rejection
from service.job_queue import JobQueue
from service.settings import Settings
from service.store import cameras, references, tracks
from service.store.cameras import Picture
from service.store.engines.store import Store, joined
from service.store.tracks import pack
from surefoot.people import SkipReason

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


@dataclass(slots=True, kw_only=True)
class _Count:
    """Bytes of the source that counts (True; of all, as long as none does), and of all others."""

    counting: str | None
    stored: dict[bool, int]
    at_s: float

    def after(self, batch: Batch) -> dict[bool, int]:
        """The same with a batch, of those for which there are tracks in it."""
        together: dict[bool, int] = {}
        for track in batch.tracks:
            counts = self.counting in (None, track.source)
            before = together.get(counts, self.stored.get(counts, 0))
            together[counts] = before + track.stored_bytes
        return together


class Quota:
    """Counts what is posted on top of what was stored; counts anew when that is too much.

    What is posted twice is counted twice until then.
    """

    def __init__(self, settings: Settings) -> None:
        self._most = settings.keep_mb * 2**20 * _BEYOND or math.inf  # 0: any
        self._counts: dict[str, _Count] = {}
        self._lock = threading.Lock()

    def check(self, store: Store, camera_id: str, batch: Batch) -> None:
        """Refuse tracks for which a camera has no room now; the store is asked where that is near.

        The source that counts and all others together have their room each, as of retention.

        Raises:
            QuotaError: well more is stored than retention will leave.
        """
        now_s = time.monotonic()
        with self._lock:
            count = self._counts.get(camera_id)
            stale = count is None or (
                self._is_too_much(count.after(batch)) and now_s - count.at_s > _RECOUNT_S
            )
        if count is None or stale:
            with store.read() as session:
                counting, stored = tracks.stored_bytes(session, camera_id)
            count = _Count(counting=counting, stored=stored, at_s=now_s)
        with self._lock:
            self._counts[camera_id] = count
            together = count.after(batch)
            if self._is_too_much(together):
                most = max(together, key=lambda of_it: together[of_it])
                whose = "the source that counts" if most else "other sources"
                raise QuotaError(
                    f"tracks: with these, {whose} would have {together[most] / 2**20:.1f} MiB of "
                    f"this camera; {self._most / _BEYOND / 2**20:g} MiB are kept "
                    f"(SUREFOOT_KEEP_MB), and at most {_BEYOND:g} times that until older ones are "
                    "deleted",
                    retry_after_s=_COME_BACK_S,
                )
            count.stored |= together

    def _is_too_much(self, together: dict[bool, int]) -> bool:
        return max(together.values(), default=0) > self._most


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Receipt:
    """The fate of the tracks of one request; `other_classes` are classes that are no person."""

    source: str
    accepted: int
    duplicates: int
    rejections: tuple[Rejection, ...]
    skipped: dict[SkipReason, int]
    other_classes: tuple[str, ...]
    detail: str | None
    ignored: tuple[str, ...]


def receive_tracks(
    connection: Connection,
    queue: JobQueue,
    camera_id: str,
    batch: Batch,
    *,
    read_by: Picture,
    max_sources: int = 16,
    watched: bool = False,
    caller: Caller | None = None,
) -> Receipt:
    """Store the good tracks of a request and have them looked at, in one transaction.

    Those of a camera that somebody has `watched` before those of others.

    A track is known by (camera, source, id, start time): one that is stored already stays, and
    counts as taken. `read_by` is the picture that the tracks were held against.

    Raises:
        NotFoundError: there is no such camera.
        StalePictureError: its picture is another by now; nothing is stored.
        NothingTakenError: there were tracks, and none of them could be taken.
        ForbiddenError: the source is another token's, or the camera others' to claim.
        TooManySourcesError: the source is new, and the camera has as many as it may have.
    """
    awaited = cameras.awaited(connection, camera_id)
    if awaited is None:
        raise no_camera(camera_id)
    if awaited.picture != read_by:
        raise StalePictureError(camera_id)
    if batch.rejections and not batch.tracks:
        raise _nothing_taken(batch)
    sources = sorted({track.source for track in batch.tracks})
    if caller is not None:
        caller.require_sources(sources)
    now = datetime.now(UTC)
    added = tracks.add(
        connection,
        [
            {
                "camera_id": camera_id,
                "source": track.source,
                "track_id": track.track_id,
                "started_s": float(track.points[0, 0]),
                "ended_s": float(track.points[-1, 0]),
                "points": pack(track.points),
                "boxes": None if track.boxes is None else pack(track.boxes),
                "heads": None if track.heads is None else pack(track.heads),
                "received_at": now,
                "first_px": track.first_px,
            }
            for track in batch.tracks
        ],
    )
    for source in sources:
        stored = added if source == batch.tracks[0].source else 0
        note_source(connection, camera_id, source, stored, max_sources, caller)
    if awaited.source and sources:
        with joined(connection) as session:
            require_claim(session, caller, camera_id)
        references.be_of_source(connection, camera_id, sources[0])
    if added and awaited.look:
        with joined(connection) as session:
            request_estimate(session, queue, camera_id, watched=watched)
    return Receipt(
        source=batch.source,
        accepted=added,
        duplicates=len(batch.tracks) - added,
        rejections=batch.rejections,
        skipped=batch.skipped,
        other_classes=batch.other_classes,
        detail=_all_skipped(batch),
        ignored=batch.ignored,
    )


def _all_skipped(batch: Batch) -> str | None:
    """Return why nothing of a request was stored, None if it had other tracks than skipped ones."""
    if batch.tracks or not batch.skipped:
        return None
    parts = []
    for reason, count in batch.skipped.items():
        text = _SKIPPED[reason]
        if reason == SkipReason.NOT_A_PERSON and batch.other_classes:
            text += f" (classes {', '.join(batch.other_classes)}); name the classes of people "
            text += "with ?classes= if they are"
        parts.append(f"{count} {text}")
    return f"No track was stored: {'; '.join(parts)}."


_SKIPPED = {
    SkipReason.NOT_A_PERSON: "not of a person",
    SkipReason.CONFIDENCE: "with confidence 0 throughout, which marks detections to be ignored",
    SkipReason.NO_ID: "without a track id: detections are not tracks",
}


def _nothing_taken(batch: Batch) -> NothingTakenError:
    count = len(batch.rejections)
    first = batch.rejections[0]
    skipped = sum(batch.skipped.values())
    beside = f", {skipped} others were skipped" if skipped else ""
    return NothingTakenError(
        f"tracks: none of {count} could be taken{beside}, the first because: {first.detail}",
        tuple(
            FieldError(pointer=f"/tracks/{each.index}", reason=f"{each.code}: {each.detail}")
            for each in batch.rejections
        ),
        batch.skipped,
    )
