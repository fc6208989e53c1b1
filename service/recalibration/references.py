"""References: when one begins, which of a camera's tracks it is of, and which come after it."""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.settings import Settings
from service.store import cameras, tracks
from service.store.tables import EstimateRecord, SiteReferenceRecord
from service.store.tracks import WindowBounds

# Fewer people than that who walk for a few seconds make no estimate, and no reference.
FEWEST_WALKERS = 5


def begin_reference(
    session: Session,
    camera_id: str,
    origin: str,
    *,
    from_s: float | None,
    by: str | None = None,
) -> SiteReferenceRecord:
    """Have a camera's next tracks, that start at or after a time, say what is usual at its site."""
    camera = cameras.find(session, camera_id)
    assert camera is not None
    record = SiteReferenceRecord(
        camera_id=camera_id,
        prior_pose_id=cameras.prior_pose(session, camera_id).id,
        origin=origin,
        requested_by=by,
        from_s=from_s,
        wanted=camera.reference_tracks,
        tracks=0,
        doubt="",
        created_at=datetime.now(UTC),
    )
    session.add(record)
    session.flush()
    return record


def window_of(reference: SiteReferenceRecord, settings: Settings) -> WindowBounds:
    """The tracks that an estimate is made of.

    While a reference is being learned, those of its period; later, those that ended after it, from
    the newest change of the camera on.
    """
    return WindowBounds(
        camera_id=reference.camera_id,
        tracks=settings.window_tracks,
        days=settings.window_days,
        started_from_s=reference.from_s,
        ended_after_s=reference.to_s,
        ended_from_s=reference.window_from_s,
    )


def made_against(reference: SiteReferenceRecord, estimate: EstimateRecord) -> bool:
    """Whether an estimate was made against a reference, not while that was being learned."""
    if reference.ready_at is None or estimate.reference_id != reference.id:
        return False
    return estimate.created_at >= reference.ready_at


def wanted_tracks(reference: SiteReferenceRecord, settings: Settings) -> int:
    """How many tracks a reference is learned of: no more than are kept."""
    return min(reference.wanted, settings.keep_tracks)


def tracks_so_far(session: Session, settings: Settings, reference: SiteReferenceRecord) -> int:
    """How many of the wanted tracks there are."""
    if reference.ready_at is not None:
        return reference.tracks
    stored = tracks.count_from(session, reference.camera_id, reference.from_s)
    return min(stored, wanted_tracks(reference, settings))
