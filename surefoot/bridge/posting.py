"""Tracks from the spool to the service, as long as it takes: what fails is logged, and waits."""

import logging
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from surefoot.bridge.backlog import Backlog
from surefoot.bridge.door import Door
from surefoot.bridge.service import LaterError, RefusedError, Service
from surefoot.bridge.spool import Group, Spool
from surefoot.bridge.tally import Tally
from surefoot.bridge.values import body_of

log = logging.getLogger("surefoot.bridge")

_GATHER_S = 1.0  # so that what ends at about the same time is one post
_FIRST_S, _LONGEST_S = 0.5, 30.0  # between two attempts
_NOT_FOUND = 404
MOST_HELD = 1_000  # tracks that the service trips over, before all is left to wait


@dataclass(kw_only=True)
class Posting:
    """What is posted, and what the service has failed on: that goes by itself, later and later."""

    spool: Spool
    service: Service
    door: Door
    tally: Tally
    _backlog: Backlog = field(default_factory=Backlog)
    _held: dict[int, tuple[float, float]] = field(default_factory=dict)  # again at, then after, s
    _logged: set[tuple[str, str]] = field(default_factory=set)

    def run(self, stopping: threading.Event) -> None:
        """Post what the spool has until the event is set."""
        delay_s = _FIRST_S
        while not stopping.is_set():
            self.spool.wait(_GATHER_S)
            wait_s = self._post_all(stopping)
            if wait_s is None:
                delay_s = _FIRST_S
                stopping.wait(_GATHER_S)
                continue
            wait_s = min(max(delay_s, wait_s), _LONGEST_S)
            stopping.wait(wait_s)
            delay_s = min(2 * delay_s, _LONGEST_S)

    def _post_all(self, stopping: threading.Event) -> float | None:
        """None once nothing is left, else how long the service wants to be left alone."""
        while not stopping.is_set():
            now_s = time.monotonic()
            resting = [number for number, (again_s, _) in self._held.items() if again_s > now_s]
            group = self.spool.next(resting, self._held)
            if group is None:
                if not self._held:
                    self._backlog.end(time.time())
                return None
            try:
                self._post(group)
            except LaterError as error:
                told = {"camera_id": group.camera, "reason": str(error)}
                self._backlog.tell(time.time(), **told, waiting=self.spool.waiting)
                if error.away or len(self._held) + len(group.tracks) > MOST_HELD:
                    return error.wait_s or 0.0
                self._hold(group, now_s)
        return None

    def _post(self, group: Group) -> None:
        """Post a group, and forget it.

        Raises:
            LaterError: nothing of it is stored yet.
        """
        bodies = list(group.tracks.values())
        body = body_of(group.head, bodies) if group.head else bodies[0]
        unknown = False
        try:
            receipt = self.service.post_tracks(group.camera, body)
            self.tally.posted(group.camera, receipt["accepted"])
            self.tally.count("tracks_rejected", len(receipt["rejected"]))
            _tell_rejected(group.camera, receipt["rejected"])
            self._note_skipped(group.camera, receipt)
        except RefusedError as error:
            unknown = error.status == _NOT_FOUND
            self.tally.count("tracks_rejected", len(group.tracks))
            _tell_refused(group, error)
        self.spool.drop(group)
        if unknown:
            self._drop_unknown()
        for number in group.tracks:
            self._held.pop(number, None)

    def _drop_unknown(self) -> None:
        """Delete at once what waits for cameras that the service does not have.

        It was kept while the service did not answer; posting it one by one would delay the rest.
        """
        newest = self.spool.newest()  # what comes later may be for a camera that is new by then
        cameras = self.door.cameras()
        if cameras is None:
            return
        dropped = self.spool.drop_others(cameras, newest)
        if dropped:
            extra = {"tracks": dropped.total(), "cameras": len(dropped), "first": min(dropped)}
            log.warning("tracks_dropped", extra=extra)
            self.tally.count("tracks_rejected", dropped.total())

    def _note_skipped(self, camera: str, receipt: dict[str, Any]) -> None:
        """Count the tracks that the service skipped; log a reason once for each camera."""
        for reason, tracks in receipt.get("skipped", {}).items():
            self.tally.count("tracks_skipped", tracks)
            if (camera, reason) in self._logged:
                continue
            if len(self._logged) >= MOST_HELD:
                self._logged.clear()
            self._logged.add((camera, reason))
            extra = {"camera_id": camera, "reason": reason, "tracks": tracks}
            log.info("posted_tracks_skipped", extra=extra)

    def _hold(self, group: Group, now_s: float) -> None:
        for number in group.tracks:
            _, delay_s = self._held.get(number, (0.0, _FIRST_S / 2))
            delay_s = min(2 * delay_s, _LONGEST_S)
            self._held[number] = (now_s + delay_s, delay_s)


def _tell_rejected(camera: str, rejected: list[dict[str, Any]]) -> None:
    if rejected:
        codes = dict(Counter(each["code"] for each in rejected))
        extra = {"camera_id": camera, "codes": codes, "first": rejected[0]["detail"]}
        log.info("tracks_rejected", extra=extra)


def _tell_refused(group: Group, error: RefusedError) -> None:
    # People who passed too shortly are everyday's.
    level = logging.INFO if error.code == "nothing_taken" else logging.WARNING
    extra = {"status": error.status, "code": error.code, "detail": error.detail}
    count = len(group.tracks)
    log.log(level, "tracks_refused", extra={"camera_id": group.camera, "tracks": count, **extra})
