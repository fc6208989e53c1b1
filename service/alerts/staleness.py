"""The alert `stale` of cameras without new estimates, or with skipped tracks."""

import time
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from models.reasons import Reason, Value
from service.alerts.alerts import end_alert, open_alert
from service.alerts.bridges import BridgeWatch
from service.enums import AlertActivity, AlertKind, AlertSource, Outcome, Severity
from service.reasons import ServiceCode
from service.settings import Settings
from service.store import alerts, cameras, tracks
from service.store.cameras import CameraRecord
from service.wording.alerts import ESTIMATED_AGAIN

# Who closed the alert knows; if nothing is better by then, it is told again.
_ANSWERED = timedelta(hours=1)


class StaleWatch:
    """Opens and ends the alerts `stale`; how long a track waits is measured here.

    By the monotonic clock, so that neither a clock that was set nor a service that was off for a
    day makes every camera stale.
    """

    def __init__(self) -> None:
        # The oldest track of a camera that nothing has looked at, and since when it is watched.
        self._waiting: dict[str, tuple[int, float]] | None = None
        self._bridges = BridgeWatch()

    def watch(self, session: Session, settings: Settings) -> dict[str, str]:
        """Bring all alerts `stale` up to date; return the cameras with a new or ended one."""
        now_s = time.monotonic()
        firing = alerts.firing_codes(session, AlertKind.STALE)
        unseen = tracks.unseen_since(session)
        if self._waiting is None:  # another worker may have told of some, which wait still
            told_s = now_s - settings.stale_after_s - 1
            told = {id_ for id_, code in firing.items() if code == ServiceCode.TRACKS_WAIT}
            self._waiting = {id_: (unseen[id_][0], told_s) for id_ in told & unseen.keys()}
        waiting = {}
        for camera_id, (pk, _) in unseen.items():
            known_pk, since_s = self._waiting.get(camera_id, (pk, now_s))
            waiting[camera_id] = pk, since_s if known_pk == pk else now_s
        self._waiting = waiting
        found: dict[str, str] = {}
        waits = {camera_id: now_s - since_s for camera_id, (_, since_s) in self._waiting.items()}
        long = {camera_id for camera_id, s in waits.items() if s > settings.stale_after_s}
        # Of hundreds, twelve times a minute: nothing can be wrong with any other.
        lacking = cameras.lacking(session, ServiceCode.TRACKS_SKIPPED)
        for camera in cameras.failing(session, besides=firing.keys() | long | lacking):
            waits_s = waits.get(camera.id, 0.0)
            reason = _why_stale(camera, settings, waits_s)
            if reason is None:
                if camera.id in firing and camera.estimate_failing_since is None:
                    _end(session, camera)
                    found[camera.id] = "ended"
            elif camera.id in firing:
                if firing[camera.id] != reason.code:
                    _open(session, settings, camera, reason, waits_s)
            elif not _answered(session, camera):
                _open(session, settings, camera, reason, waits_s)
                found[camera.id] = AlertActivity.OPENED
        self._bridges.watch(session, settings)
        return found


def _why_stale(camera: CameraRecord, settings: Settings, waits_s: float) -> Reason | None:
    """The reason why a camera's estimate is not what it should be; None where it is."""
    failed = camera.estimate_tries >= settings.stale_failures
    # While it is being looked at, it is not due: the last try may be the one that succeeds.
    if failed and camera.estimate_error is not None and camera.estimate_due_at is not None:
        values: dict[str, Value] = {
            "tries": camera.estimate_tries,
            "error": camera.estimate_error,
        }
        return Reason(code=ServiceCode.LOOKS_FAIL, values=values)
    if waits_s > settings.stale_after_s:
        waited = {"waits_s": waits_s, "limit_s": settings.stale_after_s}
        return Reason(code=ServiceCode.TRACKS_WAIT, values=waited)
    skipped = (lack for lack in camera.missing_parts if lack.code == ServiceCode.TRACKS_SKIPPED)
    return next(skipped, None)


def _open(
    session: Session, settings: Settings, camera: CameraRecord, reason: Reason, waits_s: float
) -> None:
    since = camera.estimate_failing_since or datetime.now(UTC) - timedelta(seconds=waits_s)
    open_alert(
        session,
        settings,
        camera.id,
        AlertKind.STALE,
        # Without some of its tracks a camera is watched all the same.
        Severity.WARNING if reason.code == ServiceCode.TRACKS_SKIPPED else Severity.CRITICAL,
        drift={},
        changed_at=since,
        reasons=(reason,),
        source=AlertSource.UPKEEP,
    )


def _end(session: Session, camera: CameraRecord) -> None:
    end_alert(session, camera.id, AlertKind.STALE, Outcome.CLEARED, ESTIMATED_AGAIN)


def _answered(session: Session, camera: CameraRecord) -> bool:
    last = alerts.newest(session, camera.id, AlertKind.STALE)
    if last is None or last.resolved_at is None or last.outcome == Outcome.CLEARED:
        return False
    return abs(datetime.now(UTC) - last.resolved_at) < _ANSWERED
