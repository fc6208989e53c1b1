"""Whatever is done in whatever order: all places say the same, and a firing alert always shows.

`SUREFOOT_TEST_LIFE_STEPS=2000` runs so many steps instead of a hundred or so.
"""

import html
import json
import os
import re
import shutil
import sys
import tempfile
from collections import Counter
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, ClassVar

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from prometheus_client.parser import text_string_to_metric_families as families

from service.store.alerts import POSE_KINDS
from service.store.tables import AlertRecord
from tests.service.life import PLACES, WANTED, Life, Look, still
from tests.service.shifted_clock import ShiftedClock

CAMERAS = ("one", "two")
STREET = "street"  # is looked at by the real job
NUMBERS = ("height_m", "tilt_deg", "roll_deg", "heading_deg")
MOVED = ("drifting", "out_of_range")
STEPS = int(os.environ.get("SUREFOOT_TEST_LIFE_STEPS", "0"))
WEAK = st.sampled_from([(), (), (), ("tilt",), ("tilt", "roll", "height")])

some = st.integers(0, 10)
names = st.sampled_from([None, "Ada", "Bo"])
notes = st.sampled_from([None, "a <b>note</b>"])


def said(**more: Any) -> dict[str, Any]:
    return {name: value for name, value in more.items() if value is not None}


class LifeOfCameras(RuleBasedStateMachine):
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
        found = sorted(self.firing(), key=lambda alert: (alert["kind"], str(alert["camera_id"])))
        return found[n % len(found)] if found else None

    @initialize()
    def begin(self) -> None:
        self.register("one", learned=True)

    has_camera = precondition(lambda self: bool(self.life.stands))

    # --- Cameras, people, jobs ------------------------------------------------------------------

    @rule(camera_id=st.sampled_from((*CAMERAS, STREET)), learned=st.booleans())
    def register(self, camera_id: str, learned: bool) -> None:
        if camera_id in self.life.stands:
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
    @rule(n=some, weak=WEAK, times=st.integers(1, 4))
    def be_seen(self, n: int, weak: tuple[str, ...], times: int) -> None:
        camera_id = self.camera(n)
        for _ in range(times if camera_id != STREET else 1):
            self.see(camera_id, weak)

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
        if camera_id == STREET:
            return
        self.life.stands[camera_id] = "prior"
        for _ in range(2):
            self.see(camera_id, ())
        self.life.stands[camera_id] = place
        for _ in range(4):
            self.see(camera_id, ())
        if visit:
            self.maintain(camera_id, None, 0.5)
            self.stop_maintaining(camera_id, 0)

    def see(self, camera_id: str, weak: tuple[str, ...]) -> None:
        """People walk, and the job looks at them."""
        self.life.post(camera_id, WANTED if camera_id != STREET else 4 * WANTED)
        self.look_at(camera_id, weak)

    @has_camera
    @rule(n=some, weak=WEAK)
    def look(self, n: int, weak: tuple[str, ...]) -> None:
        self.look_at(self.camera(n), weak)

    def look_at(self, camera_id: str, weak: tuple[str, ...]) -> None:
        if camera_id == STREET:
            self.life.really_look(camera_id)
            self.answered.discard(camera_id)  # it may have stored one, or not
        elif self.life.end_look(self.life.begin_look(camera_id), weak):
            self.answered.discard(camera_id)

    @has_camera
    @rule(n=some)
    def begin_a_look(self, n: int) -> None:
        camera_id = self.camera(n)
        if camera_id != STREET:
            self.looks.append(self.life.begin_look(camera_id))

    @precondition(lambda self: self.looks)
    @rule(weak=WEAK)
    def end_a_look(self, weak: tuple[str, ...]) -> None:
        look = self.looks.pop(0)
        if look.camera_id in self.life.stands and self.life.end_look(look, weak):
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

    # --- Who looks after them -------------------------------------------------------------------

    @has_camera
    @rule(n=some, by=names, note=notes)
    def accept(self, n: int, by: str | None, note: str | None) -> None:
        camera_id = self.camera(n)
        body = said(by=by, note=note)
        answer = self.call("POST", f"/cameras/{camera_id}/pose/accept", 409, json=body)
        if answer.is_success:
            self.answered.add(camera_id)
            self.last_entry("pose.accepted", camera_id, by, note)

    @has_camera
    @rule(n=some, by=names, note=notes)
    def put_back(self, n: int, by: str | None, note: str | None) -> None:
        camera_id = self.camera(n)
        self.call("POST", f"/cameras/{camera_id}/pose/put-back", json=said(by=by, note=note))
        self.answered.add(camera_id)
        self.last_entry("pose.put_back", camera_id, by, note)

    @has_camera
    @rule(n=some, by=names, sure=st.integers(0, 2))
    def learn_anew(self, n: int, by: str | None, sure: int) -> None:
        if sure:
            return
        camera_id = self.camera(n)
        self.call("POST", f"/cameras/{camera_id}/reference/reset", json=said(by=by))
        self.answered.add(camera_id)
        self.last_entry("reference.reset", camera_id, by, None)

    @rule(
        n=some,
        outcome=st.sampled_from(["put_back", "accepted", "false_alarm"]),
        by=names,
        note=notes,
    )
    def resolve(self, n: int, outcome: str, by: str | None, note: str | None) -> None:
        alert = self.alert(n)
        if alert is None:
            return
        members = [a["camera_id"] for a in self.firing() if a["group_id"] == alert["id"]]
        body = said(outcome=outcome, by=by, note=note)
        answer = self.call("POST", f"/alerts/{alert['id']}/resolve", 409, json=body)
        if not answer.is_success:
            assert outcome == "accepted"
            return
        shown = self.life.call("GET", f"/alerts/{alert['id']}").json()
        assert (shown["state"], shown["outcome"], shown["resolved_by"]) == ("resolved", outcome, by)
        if alert["kind"] in POSE_KINDS:
            ids = [*members, *([alert["camera_id"]] if alert["camera_id"] else [])]
            self.answered |= set(ids)
            for camera_id in ids:
                open_ = {a["kind"] for a in self.firing() if a["camera_id"] == camera_id}
                assert not open_ & set(POSE_KINDS), "the pose was answered for, and alerts fire on"

    @rule(n=some, by=names)
    def acknowledge(self, n: int, by: str | None) -> None:
        alert = self.alert(n)
        if alert is not None:
            self.call("POST", f"/alerts/{alert['id']}/acknowledge", json=said(by=by))

    @rule(n=some, hours=st.sampled_from([None, 0.2, 40]))
    def silence(self, n: int, hours: float | None) -> None:
        alert = self.alert(n)
        if alert is not None:
            until = None if hours is None else self.at(hours)
            self.call("POST", f"/alerts/{alert['id']}/silence", json={"until": until})

    @has_camera
    @rule(n=some, begins=st.sampled_from([None, -3.0, 1.0]), lasts=st.sampled_from([0.5, 4.0]))
    def plan_maintenance(self, n: int, begins: float | None, lasts: float) -> None:
        self.maintain(self.camera(n), begins, lasts)

    def maintain(self, camera_id: str, begins: float | None, lasts: float) -> None:
        body = {"to": self.at((begins or 0.0) + lasts), "by": "Cy"}
        if begins is not None:
            body["from"] = self.at(begins)
        self.call("POST", f"/cameras/{camera_id}/maintenance", json=body)

    @has_camera
    @rule(n=some, which=some)
    def end_maintenance(self, n: int, which: int) -> None:
        self.stop_maintaining(self.camera(n), which)

    def stop_maintaining(self, camera_id: str, which: int) -> None:
        url = f"/cameras/{camera_id}/maintenance"
        windows = self.life.call("GET", url).json()["items"]
        if windows:
            window = windows[which % len(windows)]
            self.call("DELETE", f"{url}/{window['id']}", 409)
            after = self.life.call("GET", url).json()["items"]
            kept = [each for each in after if each["id"] == window["id"]]
            assert not kept or kept[0]["to"] == window["to"], "the plan was rewritten"

    @has_camera
    @rule(n=some, which=some, hours=st.sampled_from([-0.1, 1.0]))
    def move_maintenance(self, n: int, which: int, hours: float) -> None:
        url = f"/cameras/{self.camera(n)}/maintenance"
        windows = self.life.call("GET", url).json()["items"]
        if windows:
            body = {"to": self.at(hours)}
            window = windows[which % len(windows)]
            self.call("PATCH", f"{url}/{window['id']}", 422, json=body)

    @has_camera
    @rule(n=some, what=st.sampled_from(["name", "walking_speed", "prior_pose", "reference_tracks"]))
    def change(self, n: int, what: str) -> None:
        value = {
            "name": "Another",
            "walking_speed": {"mean_mps": 1.3},
            "prior_pose": {"height_m": 6.0, "tilt_deg": 22.0, "roll_deg": 1.0, "heading_deg": 40.0},
            "reference_tracks": WANTED + 1,
        }[what]
        url = f"/cameras/{self.camera(n)}"
        self.call("PATCH", url, json={what: value}, headers={"If-Match": "*"})

    @has_camera
    @rule(n=some, keep=st.booleans())
    def put_still(self, n: int, keep: bool) -> None:
        url = f"/cameras/{self.camera(n)}/snapshot"
        if keep:
            self.call("PUT", url, content=still(), headers={"Content-Type": "image/jpeg"})
        else:
            self.call("DELETE", url, 404)

    @has_camera
    @rule(n=some)
    def train(self, n: int) -> None:
        self.call("POST", f"/cameras/{self.camera(n)}/trainings", json={"by": "Bo"})

    def at(self, hours: float) -> str:
        now = datetime.now(UTC) + self.clock.ahead
        return (now + timedelta(hours=hours)).isoformat()

    def last_entry(self, what: str, camera_id: str, by: str | None, note: str | None) -> None:
        entries = [json.loads(line) for line in self.read_log()]
        mine = [each for each in entries if each["camera_id"] == camera_id and each["what"] == what]
        assert (mine[-1]["by"], mine[-1]["note"]) == (by, note)

    def read_log(self) -> list[str]:
        answer = self.life.call("GET", "/activity", headers={"Accept": "application/x-ndjson"})
        return list(answer.text.splitlines())

    # --- What holds after every act -------------------------------------------------------------

    @invariant()
    def history_only_grows(self) -> None:
        LifeOfCameras.steps += 1
        log = self.read_log()
        assert log[: len(self.log)] == self.log
        self.log = log

    @invariant()
    def what_was_acknowledged_is_stored(self) -> None:
        for camera_id, known in self.life.acknowledged.items():
            assert set(known) <= self.life.stored(camera_id)

    @invariant()
    def every_place_says_the_same(self) -> None:
        firing = self.firing()
        pairs = [(a["camera_id"], a["kind"]) for a in firing if a["camera_id"] is not None]
        assert len(pairs) == len(set(pairs)), "two alerts of a camera and kind fire"
        fleet = self.life.call("GET", "/").text
        figures = self.figures()
        assert figures.pop("alerts") == {(a["camera_id"] or "", a["kind"]) for a in firing}
        rows = re.findall(r'<li class="row (\w+)" id="row-(\w+)".*?data-alerts="([^"]*)"', fleet)
        assert {row[1] for row in rows} == set(self.life.stands) == set(figures["state"])
        for alert in firing:
            if alert["camera_id"] is None:
                assert alert["track_source"] in fleet  # a banner
        for state, camera_id, ids in rows:
            mine = [alert for alert in firing if alert["camera_id"] == camera_id]
            assert set(ids.split()) == {alert["id"] for alert in mine}
            self.one_camera(camera_id, state, mine, fleet, figures)

    def one_camera(
        self,
        camera_id: str,
        state: str,
        mine: list[dict[str, Any]],
        fleet: str,
        figures: dict[str, Any],
    ) -> None:
        answer = self.life.call("GET", f"/cameras/{camera_id}/pose")
        body = answer.json()
        page = self.life.call("GET", f"/ui/cameras/{camera_id}").text
        assert body["state"] == state == figures["state"][camera_id]
        assert f'<section class="summary {state}"' in page
        for alert in mine:
            assert f'id="alert-{alert["id"]}"' in page, "an alert fires and is not on the page"
        self.seen[" and ".join([state, *sorted(alert["kind"] for alert in mine)])] += 1
        self.alerts_and_state(camera_id, state, mine, page)
        self.numbers(camera_id, body, state, figures)
        known = self.bodies.setdefault(camera_id, {})
        tag = answer.headers["etag"]
        assert known.setdefault(tag, answer.text) == answer.text, "one ETag, two bodies"
        if camera_id in self.answered:
            assert (body["estimated"], body["drift"]) == ([], None), "answered, and told again"

    def alerts_and_state(
        self, camera_id: str, state: str, mine: list[dict[str, Any]], page: str
    ) -> None:
        with self.life.store.read() as session:
            rows = session.query(AlertRecord).filter_by(camera_id=camera_id, state="firing").all()
            held = {row.kind for row in rows if row.source == "estimate"} & set(POSE_KINDS)
        about_pose = {alert["kind"] for alert in mine} & set(POSE_KINDS)
        headline = html.unescape(re.search(r'<p class="headline">(.*?)</p>', page, re.S)[1])
        if held:
            assert state in MOVED, "it moved, an alert fires, and the state hides it"
        if about_pose:
            assert not headline.startswith(("Standing where it should", "Where it should be"))
        if state in MOVED:
            attended = "Maintenance until" in page
            assert held or attended, "it is said to have moved, and nothing fires"
        elif not about_pose:
            assert "The camera" not in headline, headline

    def numbers(
        self, camera_id: str, body: dict[str, Any], state: str, figures: dict[str, Any]
    ) -> None:
        prior = self.life.call("GET", f"/cameras/{camera_id}").json()["prior_pose"]
        for name in NUMBERS:
            told = name in body["estimated"]
            moved = body["pose"][name] - prior[name]
            if not told:
                assert moved == pytest.approx(0.0, abs=1e-9), f"{name} is not told, and differs"
            else:
                assert moved == pytest.approx(body["drift"][name], abs=1e-6)
            number = name.split("_")[0]
            gauge = figures["drift"].get((camera_id, number))
            assert (gauge is not None) == told, f"{name} in metrics and in the pose"
        if state in ("learning", "ok") and not body["estimated"]:
            assert body["drift"] is None

    def figures(self) -> dict[str, Any]:
        found: dict[str, Any] = {"state": {}, "drift": {}, "alerts": set()}
        for family in families(self.life.call("GET", "/metrics").text):
            for sample in family.samples:
                camera_id = sample.labels.get("camera_id", "")
                if sample.name == "surefoot_camera_state" and sample.value == 1:
                    assert camera_id not in found["state"]
                    found["state"][camera_id] = sample.labels["state"]
                elif sample.name == "surefoot_camera_drift_radians":
                    found["drift"][camera_id, sample.labels["number"]] = sample.value
                elif sample.name == "surefoot_camera_drift_height_meters":
                    found["drift"][camera_id, "height"] = sample.value
                elif sample.name == "surefoot_alert_firing":
                    found["alerts"].add((camera_id, sample.labels["kind"]))
        return found


def lives(examples: int, steps: int, **more: Any) -> settings:
    return settings(
        max_examples=examples,
        stateful_step_count=steps,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        print_blob=False,
        database=None,
        **more,
    )


@pytest.mark.slow
@pytest.mark.timeout(0 if STEPS else 300)
def test_all_places_say_the_same_whatever_is_done(
    migrated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    LifeOfCameras.migrated = migrated
    if STEPS:
        phases = (Phase.generate, Phase.shrink)
        how = lives(max(STEPS // 50, 1), 50, phases=phases)
    else:
        how = lives(4, 30, derandomize=True, phases=(Phase.generate,))
    run_state_machine_as_test(LifeOfCameras, settings=how)
    with capsys.disabled():
        for name, counts in (("acts", LifeOfCameras.done), ("standings", LifeOfCameras.seen)):
            told = ", ".join(f"{count} {what}" for what, count in counts.most_common())
            sys.stdout.write(f"\n{name} in {LifeOfCameras.steps} steps: {told}\n")
