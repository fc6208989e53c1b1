"""What is served where people walk elsewhere than they did: a turned camera, or other paths."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from models.monitoring.chart import chart_from_bytes
from service.estimation.compute import compute_estimate
from service.estimation.evidence import load_evidence
from service.store import references
from service.store.references import FlowMapRecord
from tests.service.street import LENS, PRIOR, known_street

WANTED = 120


@pytest.fixture
def street(learned):
    """A street of lanes whose reference and map are learned."""

    def make(http, settings):
        return known_street(http, settings.model_copy(update={"flow_unsure_tracks": 0}), WANTED)

    return learned("paths", make)


def turned(degrees: float):
    return replace(PRIOR, heading_rad=PRIOR.heading_rad + math.radians(degrees))


def judge_by(street, tracks):
    """Have windows of so many tracks; the map grows by those of before."""
    settings = street.context.settings.model_copy(update={"window_tracks": tracks})
    street.context = replace(street.context, settings=settings)


def tracks_of_map(street):
    with street.context.store.read() as session:
        return session.get(FlowMapRecord, references.newest(session, "corner").id).tracks


def test_a_lens_that_was_zoomed_is_named_and_put_right(street):
    zoomed = replace(LENS, fx=1.2 * LENS.fx, fy=1.2 * LENS.fy)
    street.keep_to_lanes(PRIOR, 60)
    street.look()
    street.keep_to_lanes(PRIOR, 80, lens=zoomed)
    body = street.look()
    (alert,) = street.alerts(state="firing")
    assert (body["state"], alert["kind"]) == ("drifting", "lens")
    assert "focal length that differs by +2" in alert["reason"]
    refused = street.http.post("/cameras/corner/pose/accept")
    assert refused.status_code == 409
    assert "its lens looks wrong" in refused.json()["detail"]
    page = street.http.get("/ui/cameras/corner").text
    assert "The lens shows another angle of view" in page
    assert "Keep the new aim" not in page
    resolve = f"/alerts/{alert['id']}/resolve"
    street.http.post(resolve, json={"outcome": "fixed"}).raise_for_status()
    street.keep_to_lanes(PRIOR, 60)
    assert (street.look()["state"], street.alerts(state="firing")) == ("ok", [])


def test_the_window_begins_where_the_camera_turned(street):
    street.keep_to_lanes(PRIOR, 60)
    assert street.look()["tracks"] == 60
    street.keep_to_lanes(turned(6), 60)
    body = street.look()
    assert 45 <= body["tracks"] <= 72
    assert body["drift"]["heading_deg"] == pytest.approx(6, abs=1.2)
    street.keep_to_lanes(turned(6), 30)
    assert street.look()["tracks"] >= body["tracks"] + 30


def test_a_turn_is_an_alert_within_sixty_tracks_that_says_since_when_and_stops_the_map(street):
    street.keep_to_lanes(PRIOR, 60)
    assert (street.look()["state"], street.alerts()) == ("ok", [])
    before_s = street.clock_s
    street.keep_to_lanes(turned(-6), 60)
    body = street.look()
    assert body["state"] == "drifting"
    assert "if the heading had gone down (drift chart" in body["reason"]
    (alert,) = street.alerts(state="firing")
    assert alert["kind"] == "drift"
    changed_s = datetime.fromisoformat(alert["changed_at"]).timestamp()
    assert changed_s == pytest.approx(before_s, abs=12 * 5.0)  # a dozen people
    street.keep_to_lanes(turned(-6), 30)
    street.look()
    assert [one["id"] for one in street.alerts()] == [alert["id"]]
    assert tracks_of_map(street) == WANTED


def test_a_still_camera_is_not_suspected_and_its_map_grows(street):
    judge_by(street, 60)
    street.keep_to_lanes(PRIOR, 120)
    body = street.look()
    assert "drift chart" not in body["reason"]
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg", "heading_deg"]
    assert tracks_of_map(street) == WANTED + 60


def test_new_paths_leave_the_map_out_and_say_so(street):
    street.keep_to_lanes(PRIOR, 50)
    street.cross(PRIOR, 80)
    body = street.look()
    assert "people walk on none of the paths that were learned" in body["reason"]
    assert "heading_deg" not in body["estimated"]
    assert body["pose"]["heading_deg"] == pytest.approx(40)
    assert "registered" not in body["estimates"]
    assert tracks_of_map(street) == WANTED


def test_fewer_allowed_alarms_need_more(street):
    street.keep_to_lanes(turned(2), 40)
    levels = []
    for allowed in (0.01, 1.0, 100.0):
        settings = street.context.settings.model_copy(update={"false_alarms_per_year": allowed})
        with street.context.store.read() as session:
            found = compute_estimate(load_evidence(session, settings, "corner"), 0)
        levels.append(found.assessment.chart.level)
    assert levels[0] > levels[1] > levels[2]


def test_what_was_seen_while_somebody_was_at_the_camera_is_no_alarm(street):
    street.keep_to_lanes(PRIOR, 40)
    street.look()
    window = {"from": at(street.clock_s + 1), "to": at(street.clock_s + 60 * 5 + 2), "by": "Ada"}
    street.http.post("/cameras/corner/maintenance", json=window).raise_for_status()
    street.keep_to_lanes(turned(8), 60)
    street.look()
    street.keep_to_lanes(PRIOR, 40)
    assert (street.look()["state"], street.alerts()) == ("ok", [])
    street.keep_to_lanes(turned(8), 60)
    street.look()
    assert [alert["kind"] for alert in street.alerts(state="firing")] == ["drift"]


def at(time_s):
    return datetime.fromtimestamp(time_s, UTC).isoformat()


def test_a_chart_of_another_release_is_done_without(street):
    with street.context.store.write() as session:
        reference = references.newest(session, "corner")
        session.get(FlowMapRecord, reference.id).chart = b"of another release"
    judge_by(street, 60)
    street.keep_to_lanes(PRIOR, 120)
    assert street.look()["state"] == "ok"
    with street.context.store.read() as session:
        kept = session.get(FlowMapRecord, references.newest(session, "corner").id)
    assert (
        chart_from_bytes(kept.chart).walking_groups > 100
    )  # the map has grown, and its chart with it


def test_a_wrong_frame_rate_is_named(known):
    for _ in range(2):
        known.walk(PRIOR, 60, rate=20 / 30)
        body = known.look()
    (alert,) = known.alerts(state="firing")
    assert (body["state"], alert["kind"]) == ("drifting", "clock")
    assert "frames a second were taken for 25" in alert["reason"]
    assert "paths have changed" not in body["reason"]
    assert alert["drift"]["height_m"] == pytest.approx(3.0, rel=0.25)
