"""Cameras, who walks before them, and the jobs: what happens without anybody's doing."""

import re
import shutil
import tempfile
from collections import Counter
from datetime import timedelta
from pathlib import Path
from typing import Any, ClassVar

from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
)

from tests.service.life import PLACES, WANTED, Life, Look
from tests.service.shifted_clock import ShiftedClock

CAMERAS = ("one", "two")
STREET = "street"  # is looked at by the real job
NUMBERS = ("height_m", "tilt_deg", "roll_deg", "heading_deg")
UNIDENTIFIABLE = st.sampled_from([(), (), (), ("tilt",), ("tilt", "roll", "height")])

some = st.integers(0, 10)
names = st.sampled_from([None, "Ada", "Bo"])
notes = st.sampled_from([None, "a <b>note</b>"])
has_camera = precondition(lambda self: bool(self.life.stands))


def said(**more: Any) -> dict[str, Any]:
    return {name: value for name, value in more.items() if value is not None}


class LifeEvents(RuleBasedStateMachine):
    """Cameras, those who walk before them, and those who look after them."""

    migrated: ClassVar[Path]
    steps: ClassVar[int] = 0
    done: ClassVar[Counter[str]] = Counter()
    seen: ClassVar[Counter[str]] = Counter()

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.clock = ShiftedClock()
        self.clock.__enter__()
        self.life = Life(self.folder, self.migrated, self.clock)
        self.log: list[str] = []  # the history as it was read last, a line each
        self.bodies: dict[str, dict[str, str]] = {}  # of each camera, ETags and their bodies
        self.answered: set[str] = set()  # a person has spoken, and nothing was stored since
        self.looks: list[Look] = []
        self.idle = False

    def teardown(self) -> None:
        self.life.stop()
        self.clock.__exit__()
        shutil.rmtree(self.folder)

    def call(self, method: str, path: str, *may: int, **more: Any) -> Any:
        """What a person does; counted where it was not refused."""
        answer = self.life.call(method, path, *may, **more)
        if answer.is_success:
            name = re.sub(r"/[0-9a-f]{32}|/(one|two|street)\b", "/*", f"{method} {path}")
            self.done[name] += 1
        return answer

    def camera(self, n: int) -> str:
        ids = sorted(self.life.stands)
        return ids[n % len(ids)]

    def firing(self) -> list[dict[str, Any]]:
        items = self.life.call("GET", "/alerts?state=firing&limit=1000").json()["items"]
        return list(items)

    def alert(self, n: int) -> dict[str, Any] | None:
        """One that fires; where none does, a camera is knocked first, else nearly none would."""
        found = self.firing()
        if not found and self.life.stands:
            self.turn(self.camera(n), "knocked")
            found = self.firing()
        found.sort(key=lambda alert: (alert["kind"], str(alert["camera_id"])))
        return found[n % len(found)] if found else None

    @initialize()
    def begin(self) -> None:
        self.register("one", learned=True)

    # --- Cameras, people, jobs ------------------------------------------------------------------

    @rule(camera_id=st.sampled_from((*CAMERAS, STREET)), learned=st.booleans())
    def register(self, camera_id: str, learned: bool) -> None:
        if camera_id in self.life.stands:
            self.idle = True  # nothing happened, so there is nothing to compare
            return
        self.life.register(camera_id)
        self.bodies.pop(camera_id, None)
        self.answered.discard(camera_id)
        if learned:
            for _ in range(2):  # the reference, and whom it is held against
                self.see(camera_id, ())

    @has_camera
    @rule(n=some, sure=st.integers(0, 3))
    def remove(self, n: int, sure: int) -> None:
        if sure == 0:
            self.life.remove(self.camera(n))

    @has_camera
    @rule(n=some, place=st.sampled_from(sorted(PLACES)))
    def knock(self, n: int, place: str) -> None:
        self.life.stands[self.camera(n)] = place

    @has_camera
    @rule(n=some, people=st.integers(1, 12))
    def walk(self, n: int, people: int) -> None:
        self.life.post(self.camera(n), people)

    @has_camera
    @rule(n=some, unidentifiable=UNIDENTIFIABLE, times=st.integers(1, 4))
    def be_seen(self, n: int, unidentifiable: tuple[str, ...], times: int) -> None:
        camera_id = self.camera(n)
        for _ in range(times if camera_id != STREET else 1):
            self.see(camera_id, unidentifiable)

    @has_camera
    @rule(n=some, place=st.sampled_from(sorted(PLACES)))
    def be_knocked_and_seen(self, n: int, place: str) -> None:
        """Until it is told for sure, which takes some looks."""
        camera_id = self.camera(n)
        self.life.stands[camera_id] = place
        for _ in range(4 if camera_id != STREET else 1):
            self.see(camera_id, ())

    @has_camera
    @rule(n=some, place=st.sampled_from(["knocked", "raised", "far"]), visit=st.booleans())
    def turn_for_sure(self, n: int, place: str, visit: bool) -> None:
        """One that is known is knocked until it is told; at times somebody goes there at once."""
        camera_id = self.camera(n)
        self.turn(camera_id, place)
        if visit and camera_id != STREET:
            self.maintain(camera_id, None, 0.5)
            self.stop_maintaining(camera_id, 0)

    def turn(self, camera_id: str, place: str) -> None:
        if camera_id == STREET:
            return
        for there, looks in (("prior", 2), (place, 4)):
            self.life.stands[camera_id] = there
            for _ in range(looks):
                self.see(camera_id, ())

    def see(self, camera_id: str, unidentifiable: tuple[str, ...]) -> None:
        """People walk, and the job looks at them."""
        self.life.post(camera_id, WANTED if camera_id != STREET else 4 * WANTED)
        self.look_at(camera_id, unidentifiable)

    @has_camera
    @rule(n=some, unidentifiable=UNIDENTIFIABLE)
    def look(self, n: int, unidentifiable: tuple[str, ...]) -> None:
        self.look_at(self.camera(n), unidentifiable)

    def look_at(self, camera_id: str, unidentifiable: tuple[str, ...]) -> None:
        if camera_id == STREET:
            self.life.really_look(camera_id)
            self.answered.discard(camera_id)  # it may have stored one, or not
        elif self.life.finish_run(self.life.start_run(camera_id), unidentifiable):
            self.answered.discard(camera_id)

    @has_camera
    @rule(n=some)
    def begin_a_look(self, n: int) -> None:
        camera_id = self.camera(n)
        if camera_id != STREET:
            self.looks.append(self.life.start_run(camera_id))

    @precondition(lambda self: self.looks)
    @rule(unidentifiable=UNIDENTIFIABLE)
    def end_a_look(self, unidentifiable: tuple[str, ...]) -> None:
        look = self.looks.pop(0)
        if look.camera_id in self.life.stands and self.life.finish_run(look, unidentifiable):
            self.answered.discard(look.camera_id)

    @has_camera
    @rule(n=some, outcome=st.sampled_from(["succeeded", "failed", "cancelled"]))
    def end_a_training(self, n: int, outcome: str) -> None:
        camera_id = self.camera(n)
        items = self.life.call("GET", f"/cameras/{camera_id}/trainings").json()["items"]
        waiting = [item["id"] for item in items if item["state"] in ("queued", "running")]
        if waiting:
            if camera_id == STREET:
                outcome = "failed"
            self.life.end_training(waiting[0], outcome)

    @rule(hours=st.sampled_from([0.01, 0.3, 2, 30, 200]))
    def time_passes(self, hours: float) -> None:
        self.clock.ahead += timedelta(hours=hours)

    @rule()
    def reconcile(self) -> None:
        self.life.reconcile()

    @rule()
    def retain(self) -> None:
        self.life.retain()

    @rule()
    def restart(self) -> None:
        self.life.stop()
        self.life.start()
