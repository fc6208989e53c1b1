"""What those do who look after cameras."""

import json
from datetime import UTC, datetime, timedelta

from hypothesis import strategies as st
from hypothesis.stateful import (
    rule,
)

from service.enums import Action, Answer
from service.store.alerts import POSE_KINDS, answers_of
from tests.service.life import WANTED, still
from tests.service.life_events import LifeEvents, has_camera, names, notes, said, some


class LifeActions(LifeEvents):
    """Cameras, and those who look after them."""

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

    @has_camera
    @rule(n=some, by=names)
    def take_back(self, n: int, by: str | None) -> None:
        camera_id = self.camera(n)
        url = f"/cameras/{camera_id}/pose/undo"
        if self.call("POST", url, 409, json=said(by=by)).is_success:
            self.answered.discard(camera_id)
            self.last_entry("pose.undone", camera_id, by, None)

    @rule(
        n=some,
        outcome=st.sampled_from(list(Answer)),
        by=names,
        note=notes,
    )
    def resolve(self, n: int, outcome: str, by: str | None, note: str | None) -> None:
        alert = self.alert(n)
        if alert is None:
            return
        members = [a["camera_id"] for a in self.firing() if a["group_id"] == alert["id"]]
        body = said(outcome=outcome, by=by, note=note)
        answer = self.call("POST", f"/alerts/{alert['id']}/resolve", 409, 422, json=body)
        assert (answer.status_code == 422) == (outcome not in answers_of(alert["kind"]))
        if not answer.is_success:
            assert answer.status_code == 422 or outcome == "accepted"
            return
        shown = self.life.call("GET", f"/alerts/{alert['id']}").json()
        assert (shown["state"], shown["outcome"], shown["resolved_by"]) == ("resolved", outcome, by)
        if alert["kind"] in POSE_KINDS:
            ids = [*members, *([alert["camera_id"]] if alert["camera_id"] else [])]
            self.answered |= set(ids)
            for camera_id in ids:
                open_ = {a["kind"] for a in self.firing() if a["camera_id"] == camera_id}
                assert not open_ & set(POSE_KINDS), "the pose was answered for, and alerts fire on"

    @rule(
        action=st.sampled_from([Action.PUT_BACK, Action.RESET, Action.UNDO, Action.ACCEPT]),
        by=names,
    )
    def do_with_all(self, action: Action, by: str | None) -> None:
        """One act with every camera at once; what one refuses stops no other."""
        ids = sorted(self.life.stands)
        if not ids:
            return
        body = said(ids=ids, action=action, by=by)
        for item in self.call("POST", "/actions", json=body).json()["items"]:
            if item["problem"] is not None:
                assert item["problem"]["status"] == 409
                assert action in (Action.UNDO, Action.ACCEPT)
            elif action == Action.UNDO:
                self.answered.discard(item["id"])
            else:
                self.answered.add(item["id"])

    @rule(n=some, by=names, seen=st.booleans())
    def acknowledge(self, n: int, by: str | None, seen: bool) -> None:
        alert = self.alert(n)
        if alert is not None:
            body = said(by=by, acknowledged=seen)
            self.call("POST", f"/alerts/{alert['id']}/acknowledge", json=body)

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
