"""The marks of an estimate job on its camera: due, looked at up to which track, failing."""

from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.reasons import Reasons
from service.store import cameras, tracks
from service.store.cameras import CameraRecord
from service.windows.waiting import lies_ahead

LONGEST_REST_S = 600.0
_FIRST_REST_S = 5.0
_DIED = "the worker died while it looked at this camera"
_LONGEST_ERROR = 500


def may_look(camera: CameraRecord, now: datetime) -> bool:
    """Whether a camera may be looked at, or rests after a look or a failure."""
    return not rests(camera.estimate_after, now)


def rests(until: datetime | None, now: datetime) -> bool:
    """Whether a camera rests that may not be looked at until a time."""
    return lies_ahead(until, now, LONGEST_REST_S)


def rest_after_s(tries: int) -> float:
    """How long a camera rests after so many looks in a row that failed: 5 s to 10 min."""
    return float(min(_FIRST_REST_S * 2 ** min(tries - 1, 20), LONGEST_REST_S))


def leave_poisoned(session: Session, camera_id: str) -> bool:
    """Leave a camera due that two workers in a row have died of, for it has yet to rest.

    The engine runs the job of a dead worker again at once, whatever it died of.
    """
    camera = cameras.find(session, camera_id)
    if camera is None or camera.estimate_tries < 2 or may_look(camera, _now()):
        return False
    camera.estimate_due_at = camera.estimate_due_at or _now()
    if camera.estimate_error is None:
        _note_failure(camera, _DIED, _now())
    return True


def begin_look(session: Session, camera_id: str) -> int | None:
    """Take the mark "due" off a camera; returns the track that was stored last."""
    camera = cameras.find(session, camera_id)
    if camera is not None:
        now = _now()
        if camera.estimate_tries and camera.estimate_error is None:
            _note_failure(camera, _DIED, now)
        camera.estimate_due_at = None
        camera.estimate_tries += 1
        # Should the worker die of it, this is all that is left to know it by.
        camera.estimate_after = now + timedelta(seconds=rest_after_s(camera.estimate_tries))
    return tracks.newest_pk(session, camera_id)


def end_look(
    session: Session,
    camera_id: str,
    newest_pk: int | None,
    *,
    rest_s: float = 0.0,
    lacks: Reasons = (),
) -> None:
    """Note up to which track a job has looked; the reconcile sees what came after.

    The camera rests for `rest_s`, so that others have their turn. `lacks` says what failed beside
    the served estimate.
    """
    camera = cameras.find(session, camera_id)
    if camera is not None:
        camera.looked_at_pk = newest_pk
        camera.estimate_tries = 0
        camera.estimate_error = camera.estimate_failing_since = None
        camera.estimate_after = _now() + timedelta(seconds=min(rest_s, LONGEST_REST_S))
        camera.lacks = lacks


def note_lacks(session: Session, camera_id: str, said: Reasons) -> None:
    """Note what failed beside an estimate after that was stored."""
    camera = cameras.find(session, camera_id)
    if camera is not None:
        camera.lacks = (*camera.lacks, *said)


def fail_look(session: Session, camera_id: str, error: str) -> None:
    """Note that a look failed: the camera stays due, and rests the longer the more often."""
    camera = cameras.find(session, camera_id)
    if camera is not None:
        now = _now()
        _note_failure(camera, error, now)
        camera.estimate_due_at = camera.estimate_due_at or now
        camera.estimate_after = now + timedelta(seconds=rest_after_s(camera.estimate_tries))


def _note_failure(camera: CameraRecord, error: str, now: datetime) -> None:
    camera.estimate_error = error[:_LONGEST_ERROR]
    camera.estimate_failing_since = camera.estimate_failing_since or now


def _now() -> datetime:
    return datetime.now(UTC)
