"""The estimate queue: cameras that are due, were looked at up to a track, or cool down."""

from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.reasons import Reason, Value
from service.job_queue import JobQueue
from service.reasons import Reasons, ServiceCode
from service.store import cameras, estimates, tracks
from service.store.cameras import CameraRecord
from service.store.run_budget import RunBudget

LONGEST_COOLDOWN_S = 600.0
_FIRST_COOLDOWN_S = 5.0
_DIED = "the worker died while it looked at this camera"
_LONGEST_ERROR = 500
# How looks end that had more to do than a worker can; the next one has a share of their tracks.
_TOO_MUCH = (_DIED, "EffortExceededError", "MemoryError")
_NEXT_SHARE, _LEAST_SHARE = 0.25, 1e-3
_NAMED = 5  # tracks in a reason
_SKIPPED = ServiceCode.TRACKS_SKIPPED


def request_estimate(
    session: Session, queue: JobQueue, camera_id: str, *, watched: bool = False
) -> None:
    """Have a camera's tracks looked at; requests that wait already cover this one.

    Before others where somebody has `watched` it, or it may have moved. One that cools down, or is
    being looked at, is queued by the upkeep when its time has come.
    """
    camera = session.get(CameraRecord, camera_id)
    if camera is not None and watched:
        camera.full_estimate_asked = True
    if camera is not None and camera.estimate_due_at is None:
        now = _now()
        camera.estimate_due_at = now
        if not is_cooling(camera.estimate_after, now):
            urgent = watched or _may_have_moved(session, camera_id)
            queue.enqueue_estimate(session, camera_id, now, urgent=urgent)


def queue_overlooked(session: Session, queue: JobQueue) -> list[str]:
    """Queue a look at cameras that are due and may be looked at, without a job; the longest first.

    They were posted to while they were looked at or cooled down, or the engine has lost their job.
    """
    now, found = _now(), []
    for camera_id, due_at, until in queue.due_without_job(session):
        if not is_cooling(until, now):
            urgent = _may_have_moved(session, camera_id)
            queue.enqueue_estimate(session, camera_id, due_at, urgent=urgent)
            found.append(camera_id)
    return found


def is_cooling(until: datetime | None, now: datetime) -> bool:
    """True where a camera that may be looked at from a time on is to wait for it.

    A time beyond the longest cooldown was set before the clock was set back: waiting for it would
    take as long as the clock jumped, so it counts as come.
    """
    longest = timedelta(seconds=LONGEST_COOLDOWN_S)
    return until is not None and timedelta(0) < until - now <= longest


def cooldown_s(tries: int) -> float:
    """The cooldown of a camera after so many looks in a row that failed: 5 s to 10 min."""
    return float(min(_FIRST_COOLDOWN_S * 2 ** min(tries - 1, 20), LONGEST_COOLDOWN_S))


def leave_poisoned(session: Session, camera_id: str) -> bool:
    """Leave a camera due that two workers in a row have died of, for it has yet to cool down.

    The engine runs the job of a dead worker again at once, whatever it died of.
    """
    camera = session.get(CameraRecord, camera_id)
    if camera is None or camera.estimate_tries < 2 or not is_cooling(camera.estimate_after, _now()):
        return False
    camera.estimate_due_at = camera.estimate_due_at or _now()
    if camera.estimate_error is None:
        _note_failure(camera, _DIED, _now())
    return True


def start_run(session: Session, camera_id: str) -> tuple[int | None, bool]:
    """Start an estimation run of a camera, which is then no longer due.

    Returns:
        The newest stored track, and whether a full estimate is requested.
    """
    camera, asked = session.get(CameraRecord, camera_id), False
    if camera is not None:
        asked, camera.full_estimate_asked = camera.full_estimate_asked, False
        now = _now()
        if camera.estimate_tries and camera.estimate_error is None:
            _note_failure(camera, _DIED, now)
        camera.estimate_due_at = None
        camera.estimate_tries += 1
        # If the worker dies during the run, this is its only trace.
        camera.estimate_after = now + timedelta(seconds=cooldown_s(camera.estimate_tries))
    return tracks.newest_pk(session, camera_id), asked


def budget_of(session: Session, camera_id: str) -> RunBudget:
    """The budget of the current run: a smaller one after runs that exceeded theirs.

    It stays small as long as tracks are skipped.
    """
    camera = session.get(CameraRecord, camera_id)
    if camera is None:
        return RunBudget()
    kept = (each.values["share"] for each in camera.missing_parts if each.code == _SKIPPED)
    share = next((value for value in kept if isinstance(value, float)), 1.0)
    if camera.estimate_error is not None and camera.estimate_error.startswith(_TOO_MUCH):
        share *= _NEXT_SHARE ** max(camera.estimate_tries - 1, 0)
    return RunBudget(max(share, _LEAST_SHARE))


def skipped_by(budget: RunBudget) -> Reasons:
    """The reason that names the tracks that a run skipped; empty if it skipped none."""
    if not budget.skipped:
        return ()
    names = list(dict.fromkeys(budget.skipped.values()))[:_NAMED]
    values: dict[str, Value] = {
        "tracks": len(budget.skipped),
        "track_ids": names,
        "share": budget.share,
    }
    return (Reason(code=_SKIPPED, values=values),)


def finish_run(
    session: Session,
    camera_id: str,
    newest_pk: int | None,
    *,
    rest_s: float = 0.0,
    failures: Reasons = (),
) -> None:
    """Finish a run that has read the tracks up to `newest_pk`.

    No run of this camera starts for `rest_s`, so that other cameras have their turn. `failures`
    are those beside the served estimate.
    """
    now = _now()
    cameras.finish_run(
        session,
        camera_id,
        newest_pk,
        now,
        now + timedelta(seconds=min(rest_s, LONGEST_COOLDOWN_S)),
        failures,
    )


def note_partial_failures(session: Session, camera_id: str, failures: Reasons) -> None:
    """Add failures beside an estimate that is stored already."""
    camera = session.get(CameraRecord, camera_id)
    if camera is not None:
        camera.missing_parts = (*camera.missing_parts, *failures)


def fail_run(session: Session, camera_id: str, error: str) -> None:
    """Record that a run failed: the camera stays due, with a longer cooldown each time."""
    camera = session.get(CameraRecord, camera_id)
    if camera is not None:
        now = _now()
        _note_failure(camera, error, now)
        camera.estimate_due_at = camera.estimate_due_at or now
        camera.estimate_after = now + timedelta(seconds=cooldown_s(camera.estimate_tries))


def _may_have_moved(session: Session, camera_id: str) -> bool:
    last = estimates.newest(session, camera_id)
    return last is not None and last.suspects_move


def _note_failure(camera: CameraRecord, error: str, now: datetime) -> None:
    camera.estimate_error = error[:_LONGEST_ERROR]
    camera.estimate_failing_since = camera.estimate_failing_since or now


def _now() -> datetime:
    return datetime.now(UTC)
