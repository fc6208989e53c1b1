"""Whatever is done in whatever order: all places say the same, and a firing alert always shows.

`SUREFOOT_TEST_LIFE_STEPS=400` runs so many steps, instead of some thirty, or 2,000 by night.
"""

import html
import os
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import (
    invariant,
    run_state_machine_as_test,
)
from prometheus_client.parser import text_string_to_metric_families as families

from service.store.alerts import POSE_KINDS, AlertRecord
from tests.service.life_activity import LifeActions
from tests.service.life_events import (
    NUMBERS,
)

STEPS = int(os.environ.get("SUREFOOT_TEST_LIFE_STEPS", "0"))


class LifeOfCameras(LifeActions):
    """What holds after every activity."""

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
        if self.idle:
            self.idle = False
            return
        firing = self.firing()
        pairs = [(a["camera_id"], a["kind"]) for a in firing if a["camera_id"] is not None]
        assert len(pairs) == len(set(pairs)), "two alerts of a camera and kind fire"
        fleet = self.life.call("GET", "/").text
        metrics = self.metrics()
        assert metrics.pop("alerts") == {(a["camera_id"] or "", a["kind"]) for a in firing}
        rows = re.findall(r'<li class="row (\w+)" id="row-(\w+)".*?data-alerts="([^"]*)"', fleet)
        assert {row[1] for row in rows} == set(self.life.stands) == set(metrics["state"])
        for alert in firing:
            if alert["camera_id"] is None:
                assert alert["track_source"] in fleet  # a banner
        self.all_alerts(firing, fleet)
        for shown, camera_id, ids in rows:
            mine = [alert for alert in firing if alert["camera_id"] == camera_id]
            assert set(ids.split()) == {alert["id"] for alert in mine}
            self.one_camera(camera_id, shown, mine, fleet, metrics)

    def all_alerts(self, firing: list[dict[str, Any]], fleet: str) -> None:
        """The page of all alerts has those that fire; titles count those that wait for somebody."""
        page = self.life.call("GET", "/ui/alerts").text
        listed = re.findall(r'<li class="alert-row" id="alert-(\w+)"', page)
        assert set(listed) == {alert["id"] for alert in firing}
        order = []
        for alert in firing:
            if alert["group_id"] not in listed:  # those for which another speaks are right below it
                below = [each["id"] for each in firing if each["group_id"] == alert["id"]]
                order += [alert["id"], *below]
        assert listed == order, "another order"
        quiet = ("acknowledged", "silenced", "group_id")
        waiting = sum(not any(alert[each] for each in quiet) for alert in firing)
        for title, text in (("Cameras", fleet), ("Alerts", page)):
            count = f"({waiting}) " if waiting else ""
            assert f"<title>{count}{title}" in text

    def one_camera(
        self,
        camera_id: str,
        shown: str,
        mine: list[dict[str, Any]],
        fleet: str,
        metrics: dict[str, Any],
    ) -> None:
        # A wrong clock moves no camera: pages show it as what it is.
        kinds = {alert["kind"] for alert in mine}
        state = "drifting" if shown == "clock" else shown
        assert (shown == "clock") == (
            state == "drifting" and "clock" in kinds and "drift" not in kinds
        )
        answer = self.life.call("GET", f"/cameras/{camera_id}/pose")
        body = answer.json()
        page = self.life.call("GET", f"/ui/cameras/{camera_id}").text
        assert body["state"] == state == metrics["state"][camera_id]
        assert f'<section class="summary {shown}"' in page
        for alert in mine:
            assert f'id="alert-{alert["id"]}"' in page, "an alert fires and is not on the page"
        self.seen[" and ".join([state, *sorted(alert["kind"] for alert in mine)])] += 1
        self.alerts_and_state(camera_id, state, mine, page)
        self.numbers(camera_id, body, state, metrics)
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
            assert state == "drifting", "it moved, an alert fires, and the state hides it"
        if about_pose:
            assert not headline.startswith(("Standing where it should", "Where it should be"))
        if state == "drifting":
            attended = "Maintenance until" in page
            assert held or attended, "it is said to have moved, and nothing fires"
        elif not about_pose:
            assert "The camera" not in headline, headline

    def numbers(
        self, camera_id: str, body: dict[str, Any], state: str, metrics: dict[str, Any]
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
            gauge = metrics["drift"].get((camera_id, number))
            assert (gauge is not None) == told, f"{name} in metrics and in the pose"
        if state in ("learning", "ok") and not body["estimated"]:
            assert body["drift"] is None

    def metrics(self) -> dict[str, Any]:
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
@pytest.mark.parametrize(
    "examples",  # of 30 acts each, the first of them none at all
    [
        pytest.param(2, marks=pytest.mark.timeout(0 if STEPS else 300)),
        pytest.param(68, marks=[pytest.mark.nightly, pytest.mark.timeout(0)]),
    ],
)
def test_all_places_say_the_same_whatever_is_done(
    migrated: Path, capsys: pytest.CaptureFixture[str], examples: int
) -> None:
    LifeOfCameras.migrated = migrated
    if STEPS:
        phases = (Phase.generate, Phase.shrink)
        how = lives(max(STEPS // 50, 1), 50, phases=phases)
    else:
        how = lives(examples, 30, derandomize=True, phases=(Phase.generate,))
    run_state_machine_as_test(LifeOfCameras, settings=how)
    with capsys.disabled():
        for name, counts in (("acts", LifeOfCameras.done), ("standings", LifeOfCameras.seen)):
            told = ", ".join(f"{count} {what}" for what, count in counts.most_common())
            sys.stdout.write(f"\n{name} in {LifeOfCameras.steps} steps: {told}\n")
