"""States and alerts of cameras to retained topics, as the service's stream of events tells of them.

An event says whose state is to be asked for: what is published is what the API says. Whenever the
stream begins anew all are asked for: no event that was missed leaves a topic behind.
"""

import json
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from surefoot.bridge.home_assistant import discovery_of
from surefoot.bridge.service import LaterError, RefusedError, Service

log = logging.getLogger("surefoot.bridge")

_GATHER_S = 1.0  # a camera that is looked at often is asked for once in so long
_REFRESH_S = 300.0  # new names, removed cameras, and what no event tells of
_FIRST_S, _LONGEST_S = 1.0, 30.0
_STATE_FIELDS = ("state", "reason", "tracks", "moved", "drift", "updated_at")
_ALERT_FIELDS = ("id", "kind", "severity", "reason", "opened_at", "acknowledged")
Say = Callable[[str, str], None]


@dataclass(kw_only=True)
class Outward:
    """What is known of the cameras, and how it is said; `listen` and `tell` run in two threads."""

    say: Say
    prefix: str
    availability: str
    discovery: str | None
    version: str
    note_camera: Callable[[str], object] = lambda _: None  # an event is about this camera
    _known: set[str] = field(default_factory=set)
    _changed: set[str] = field(default_factory=set)
    _all_changed: bool = True
    _news: threading.Condition = field(default_factory=threading.Condition)

    def listen(self, service: Service, stopping: threading.Event) -> None:
        """Follow the events; each stream goes on where the last one ended."""
        after: str | None = None
        delay_s = _FIRST_S
        while not stopping.is_set():
            try:
                begun = False
                for event in service.events(after):
                    delay_s = _FIRST_S
                    if not begun:
                        begun = True
                        self._note_all()
                    self.say(self.availability, "online")
                    if stopping.is_set():
                        return
                    if event is not None:
                        after = event.id
                        self._note(json.loads(event.data))
            except (LaterError, RefusedError) as error:
                self.say(self.availability, "offline")
                log.warning("events_wait", extra={"reason": str(error)})
                stopping.wait(delay_s)
                delay_s = min(2 * delay_s, _LONGEST_S)

    def tell(self, service: Service, stopping: threading.Event) -> None:
        """Publish what has changed, and now and then all."""
        refreshed_s = -_REFRESH_S
        while not stopping.is_set():
            with self._news:
                self._news.wait_for(lambda: self._changed or self._all_changed, _GATHER_S)
                changed, self._changed = self._changed, set()
                every, self._all_changed = self._all_changed, False
            try:
                if every or time.monotonic() - refreshed_s >= _REFRESH_S:
                    changed |= self._find_cameras(service)
                    refreshed_s = time.monotonic()
                self._tell(service, changed)
            except (LaterError, RefusedError) as error:
                log.warning("states_wait", extra={"reason": str(error)})
                refreshed_s = -_REFRESH_S
                stopping.wait(_LONGEST_S / 3)
            stopping.wait(_GATHER_S)

    def _note(self, event: dict[str, Any]) -> None:
        """Remember of whom an event is: a pose's or a training's camera, or all of a group's."""
        named = [event.get("camera_id"), *(event.get("camera_ids") or ())]
        cameras = [each for each in named if each is not None]
        for each in cameras:
            self.note_camera(each)
        with self._news:
            self._changed.update(cameras)
            self._news.notify()

    def _note_all(self) -> None:
        with self._news:
            self._all_changed = True
            self._news.notify()

    def _find_cameras(self, service: Service) -> set[str]:
        """The cameras that there are; what was said of others is taken back."""
        found = {each["id"]: each["name"] for each in service.items("/cameras")}
        for camera_id in self._known - found.keys():
            self._forget(camera_id)
        for camera_id, name in found.items():
            self._introduce(camera_id, name)
        self._known = set(found)
        return set(found)

    def _tell(self, service: Service, changed: set[str]) -> None:
        if not changed:
            return
        alerts = list(service.items("/alerts", state="firing"))
        for camera_id in sorted(changed):
            try:
                if camera_id not in self._known:
                    name = service.get(f"/cameras/{camera_id}")["name"]
                    self._introduce(camera_id, name)
                    self._known.add(camera_id)
                pose = service.get(f"/cameras/{camera_id}/pose")
            except RefusedError:  # removed
                self._forget(camera_id)
                continue
            firing = [
                {name: each[name] for name in _ALERT_FIELDS}
                for each in alerts
                if camera_id in (each["camera_id"], *(each["camera_ids"] or ()))
            ]
            document = {name: pose.get(name) for name in _STATE_FIELDS}
            self.say(f"{self.prefix}/{camera_id}/state", json.dumps(document))
            told = {"firing": sorted({each["kind"] for each in firing}), "alerts": firing}
            self.say(f"{self.prefix}/{camera_id}/alert", json.dumps(told))

    def _introduce(self, camera_id: str, name: str) -> None:
        if self.discovery is not None:
            topics = f"{self.prefix}/{camera_id}"
            config = discovery_of(camera_id, name, topics, self.availability, self.version)
            self.say(self._config_topic(camera_id), config)

    def _forget(self, camera_id: str) -> None:
        self._known.discard(camera_id)
        for what in ("state", "alert"):
            self.say(f"{self.prefix}/{camera_id}/{what}", "")
        if self.discovery is not None:
            self.say(self._config_topic(camera_id), "")

    def _config_topic(self, camera_id: str) -> str:
        return f"{self.discovery}/device/surefoot_{camera_id}/config"
