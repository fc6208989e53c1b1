"""Take in tracks."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection

from service.cameras.posts import check_picture
from service.cameras.sources import note_source
from service.errors import FieldError, NothingTakenError
from service.estimate_queue import request_estimate
from service.formats.track import Batch, Rejection
from service.job_queue import JobQueue
from service.store import references, tracks
from service.store.cameras import Picture
from service.store.engines.store import joined
from service.store.tracks import pack


@dataclass(frozen=True, slots=True, kw_only=True)
class Receipt:
    """The fate of the tracks of one request."""

    accepted: int
    duplicates: int
    rejections: tuple[Rejection, ...]
    left_out: int


def receive_tracks(
    connection: Connection,
    queue: JobQueue,
    camera_id: str,
    batch: Batch,
    *,
    read_by: Picture,
    max_sources: int = 16,
    watched: bool = False,
) -> Receipt:
    """Store the good tracks of a request and have them looked at, in one transaction.

    Those of a camera that somebody has `watched` before those of others.

    A track is known by (camera, source, id, start time): one that is stored already stays, and
    counts as taken. `read_by` is the picture that the tracks were held against.

    Raises:
        NotFoundError: there is no such camera.
        StalePictureError: its picture is another by now; nothing is stored.
        NothingTakenError: there were tracks, and none of them could be taken.
        TooManySourcesError: the source is new, and the camera has as many as it may have.
    """
    awaited = check_picture(connection, camera_id, read_by)
    if batch.rejections and not batch.tracks:
        raise _nothing_taken(batch)
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
            }
            for track in batch.tracks
        ],
    )
    sources = sorted({track.source for track in batch.tracks})
    for source in sources:
        stored = added if source == batch.tracks[0].source else 0
        note_source(connection, camera_id, source, stored, max_sources)
    if awaited.source and sources:
        references.be_of_source(connection, camera_id, sources[0])
    if added and awaited.look:
        with joined(connection) as session:
            request_estimate(session, queue, camera_id, watched=watched)
    return Receipt(
        accepted=added,
        duplicates=len(batch.tracks) - added,
        rejections=batch.rejections,
        left_out=batch.left_out,
    )


def _nothing_taken(batch: Batch) -> NothingTakenError:
    count = len(batch.rejections)
    first = batch.rejections[0]
    return NothingTakenError(
        f"tracks: none of {count} could be taken, the first since: {first.detail}",
        tuple(
            FieldError(pointer=f"/tracks/{each.index}", reason=f"{each.code}: {each.detail}")
            for each in batch.rejections
        ),
    )
