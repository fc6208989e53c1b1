"""The whole way from posted people to the served pose: reference, window, change, doubt."""

import math
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from models.paths.reference import paths_from_bytes, paths_to_bytes
from models.pose import estimate_pose, learn_site
from models.walking.estimate import joint_estimate
from models.walking.speed_reference import reference_from_bytes
from service.estimation.compute import compute_estimate
from service.estimation.estimates import save_estimate
from service.estimation.evidence import Unpacked, load_evidence
from service.store import references
from service.workers.estimate import learn_if_due
from tests.conftest import CAMERA, track
from tests.service.estimation.conftest import WANTED
from tests.service.street import KNOCKED, LENS, PRIOR, Street, tall

# Of people who walk everywhere alike, as `walk` has them: a turn would not be noticed.
STILL = "learning"


def reference_of(street):
    with street.context.store.read() as session:
        return references.newest(session, "corner")


def as_stored(flow):
    return paths_from_bytes(paths_to_bytes(flow))


def served(body):
    pose = body["pose"]
    return [pose["tilt_deg"], pose["roll_deg"], pose["height_m"]]


def numbers(pose):
    return [math.degrees(pose.tilt_rad), math.degrees(pose.roll_rad), pose.height_m]


def test_a_reference_is_learned_of_the_first_tracks_without_any_model(street):
    street.walk(PRIOR, 40)
    body = street.look()
    assert body["state"] == "learning"
    assert body["reason"] == "40 of 60 people for the reference"
    assert body["reason_code"] == "reference_tracks"
    assert body["reason_values"] == {"counted": 40, "wanted": 60, "tracks": 40, "pieces": 0}
    assert served(body) == pytest.approx(numbers(PRIOR))
    assert (body["estimated"], body["sd"], body["drift"]) == ([], None, None)
    assert body["estimates"]["joint"]["tracks"] == 40  # under an assumed walking speed
    assert body["reference"]["walking_speed_mps"] is None
    street.walk(PRIOR, 40)  # 20 of these are the reference's, 20 come after it
    body = street.look()
    assert body["reference"]["state"] == "ready"
    assert body["reference"]["tracks"] == WANTED
    assert body["reference"]["walking_speed_mps"] == pytest.approx(1.4, abs=0.05)
    assert body["tracks"] == 20
    assert body["state"] == STILL
    assert body["model_id"] is None
    assert set(body["estimates"]) == {"joint", "registered"}
    learned = reference_from_bytes(reference_of(street).data)
    assert abs(math.degrees(learned.offset[0])) < 1
    assert learned.offset_covariance[2, 2] > 0


def test_what_is_served_is_what_the_estimator_says_offline(street):
    street.walk(PRIOR, WANTED)
    street.walk(KNOCKED, 50)
    body = street.look()
    known, seen = street.observed(0, WANTED), street.observed(WANTED, WANTED + 50)
    site = learn_site(known, LENS, PRIOR)
    found = estimate_pose(seen, replace(site, paths=as_stored(site.paths)))
    assert served(body) == pytest.approx(numbers(found.pose), abs=1e-6)
    assert served(body)[0] == pytest.approx(27, abs=1.5)
    sd, move = found.posterior.sd, found.drift.move
    assert body["sd"]["tilt_deg"] == pytest.approx(math.degrees(sd.tilt_rad), abs=1e-6)
    assert body["state"] == "drifting"
    assert body["moved"] >= move.moved  # the chart may be surer than the pose
    assert body["moved_parameters"]["roll_deg"] == pytest.approx(move.parameters["roll"], abs=1e-6)
    raw = body["estimates"]["joint"]
    assert raw["tilt_deg"] == pytest.approx(math.degrees(found.joint.raw[0]), abs=1e-6)


@pytest.fixture
def laned(learned):
    """A street of lanes that has been still for 30 people after its reference."""

    def make(http, settings):
        http.post("/cameras", json={**CAMERA, "reference_tracks": 150}).raise_for_status()
        street = Street(http, settings)
        street.keep_to_lanes(PRIOR, 180)
        street.look()
        return street

    return learned("site-lanes", make)


@pytest.mark.parametrize("pan_deg", [5, -5])
def test_a_pure_pan_is_served_and_opens_an_alert(laned, pan_deg):
    street = laned
    body = street.pose()
    assert body["state"] == "ok"
    assert body["pose"]["heading_deg"] == pytest.approx(40, abs=1.5)
    panned = replace(PRIOR, heading_rad=PRIOR.heading_rad + math.radians(pan_deg))
    for _ in range(2):
        street.keep_to_lanes(panned, 200)
        body = street.look()
    assert body["estimated"] == ["height_m", "tilt_deg", "roll_deg", "heading_deg"]
    assert body["drift"]["heading_deg"] == pytest.approx(pan_deg, abs=1.0)
    assert body["pose"]["heading_deg"] == pytest.approx(40 + body["drift"]["heading_deg"])
    assert body["drift"]["angle_deg"] == pytest.approx(5, abs=1.0)
    assert body["state"] == "drifting"
    (alert,) = street.alerts()
    assert (alert["kind"], alert["state"]) == ("drift", "firing")
    assert alert["drift"]["heading_deg"] == body["drift"]["heading_deg"]
    assert "heading" in alert["reason"]


def test_the_window_begins_at_a_change_and_the_pose_arrives(known):
    known.walk(PRIOR, 40)
    assert known.look()["state"] == STILL
    moved_s = known.clock_s
    known.walk(KNOCKED, 30)
    body = known.look()
    assert 25 <= body["tracks"] <= 35  # those after the knock, not 70
    np.testing.assert_allclose(served(body)[:2], numbers(KNOCKED)[:2], atol=1.5)
    known.walk(KNOCKED, 10)
    body = known.look()
    assert body["state"] == "drifting"
    (alert,) = known.alerts()
    assert alert["kind"] == "drift"
    changed_s = datetime.fromisoformat(alert["changed_at"]).timestamp()
    assert abs(changed_s - moved_s) < 60  # people come every 5 s
    assert datetime.fromisoformat(body["from"]).timestamp() >= changed_s - 60


def test_a_still_camera_keeps_its_window(known):
    for seen in (40, 80):
        known.walk(PRIOR, 40)
        body = known.look()
        assert (body["state"], body["tracks"]) == (STILL, seen)
    assert known.alerts() == []


def test_after_a_reset_the_next_tracks_make_the_reference(known):
    known.walk(KNOCKED, 30)
    known.look()
    known.http.post("/cameras/corner/reference/reset").raise_for_status()
    body = known.look()
    assert body["reason"] == "0 of 60 people for the reference"
    known.clock_s += 60  # somebody climbs up and turns it back
    known.walk(PRIOR, WANTED)
    assert known.look()["reference"]["state"] == "ready"
    known.walk(PRIOR, 30)
    body = known.look()
    assert (body["state"], body["tracks"]) == (STILL, 30)
    assert reference_of(known).origin == "reset"
    assert served(body)[0] == pytest.approx(22, abs=1)


def test_after_accepting_the_new_pose_is_the_one_that_drift_is_against(known):
    known.walk(KNOCKED, 60)
    before = served(known.look())
    known.http.post("/cameras/corner/pose/accept").raise_for_status()
    known.walk(KNOCKED, WANTED)
    known.walk(KNOCKED, 30)
    body = known.look()
    assert body["state"] == STILL
    assert abs(body["drift"]["tilt_deg"]) < 1
    assert served(body)[0] == pytest.approx(before[0], abs=1)


def test_one_group_walking_one_way_tells_nothing(known):
    rng = np.random.default_rng(5)
    known.clock_s += 100
    people = []
    for number in range(14):
        steps = np.arange(25)
        u = 200 + 12.0 * steps + 20 * number + rng.normal(0, 1, 25)
        v = 400 + 4.0 * steps + 3 * number + rng.normal(0, 1, 25)
        rows = np.column_stack([known.clock_s + 0.4 * steps, u, v])
        people.append({"id": f"group-{number}", "points": rows.tolist()})
    known.http.post("/cameras/corner/tracks", json={"tracks": people}).raise_for_status()
    body = known.look()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert "of 1 walking group, at least" in body["reason"]
    assert served(body) == pytest.approx(numbers(PRIOR))
    assert "joint" in body["estimates"]
    assert known.alerts() == []


def test_people_who_all_cross_the_picture_tell_its_roll_alone(known):
    known.cross(KNOCKED, 30)
    body = known.look()
    assert body["estimated"] == ["roll_deg"]
    assert served(body)[1] == pytest.approx(-3, abs=1.5)
    assert [served(body)[0], served(body)[2]] == pytest.approx([22.0, 6.0])
    assert (body["sd"]["tilt_deg"], body["drift"]["height_m"]) == (None, None)
    assert "cannot tell tilt" in body["reason"]


def test_a_reference_far_from_its_prior_pose_fires_one_alert(street):
    elsewhere = replace(PRIOR, tilt_rad=math.radians(16), roll_rad=math.radians(-5))
    street.walk(elsewhere, 2 * WANTED)
    body = street.look()
    assert "the prior pose is wrong" in body["reason"]
    (alert,) = street.alerts()
    assert (alert["kind"], alert["severity"], alert["drift"]) == ("drift", "warning", {})
    assert alert["reason"] in body["reason"]
    for _ in range(3):
        street.walk(elsewhere, 10)
        body = street.look()
    (alert,) = street.alerts()
    assert alert["state"] == "firing"  # estimates against the reference do not end it
    assert "the prior pose is wrong" in body["reason"]
    street.http.post("/cameras/corner/pose/accept").raise_for_status()
    assert street.alerts()[0]["outcome"] == "accepted"


def test_a_reference_of_runners_doubts_the_clock(street):
    street.walk(PRIOR, WANTED, rate=2.0)
    body = street.look()
    (alert,) = street.alerts()
    assert (alert["kind"], alert["severity"]) == ("clock", "warning")
    assert "frame rate is wrong" in body["reason"]


def test_boxes_carry_how_tall_people_are(street):
    street.walk(PRIOR, WANTED, form="boxes")
    street.walk(PRIOR, 40, form="boxes")
    body = street.look()
    site = reference_from_bytes(reference_of(street).data)
    assert site.statures is not None
    assert np.median([np.median(tall(PRIOR, seen)) for seen in street.seen]) == pytest.approx(
        site.stature_m, rel=0.02
    )
    offline = joint_estimate(street.observed(WANTED, WANTED + 40), PRIOR, site)
    said = body["estimates"]["joint"]
    assert said["height_m"] == pytest.approx(math.exp(offline.raw[2]), abs=1e-6)
    assert body["sd"]["height_m"] < 0.15  # by speeds alone it is 0.25 m


def test_people_who_stand_make_no_reference(street):
    for number in range(WANTED):
        short = track(str(number), start_s=1_700_000_000.0 + 20 * number, count=20)
        for point in short["points"]:
            point[1] += 5000 if number >= 3 else 0  # outside the image: no step is seen of them
        short["points"] = [[t, min(u, 2500.0), v] for t, u, v in short["points"]]
        street.http.post("/cameras/corner/tracks", json={"tracks": [short]}).raise_for_status()
    body = street.look()
    assert body["reason"] == f"{WANTED} of {2 * WANTED} people for the reference"
    assert body["reference"]["state"] == "learning"


def test_another_walking_speed_learns_the_same_tracks_again(known):
    first = reference_of(known)
    change = {"walking_speed": {"mean_mps": 1.2, "sd_mps": 0.1}}
    known.http.patch("/cameras/corner", json=change, headers={"If-Match": "*"}).raise_for_status()
    assert known.look()["reference"]["state"] == "ready"
    again = reference_of(known)
    assert again.id != first.id
    assert again.to_s == first.to_s


def test_what_a_worker_had_learned_when_it_died_is_not_learned_again(street):
    street.walk(PRIOR, WANTED + 40)
    learn_if_due(street.context, "corner", Unpacked())  # and no estimate came of it
    learned = reference_of(street)
    again = Street(street.http, street.context.settings)
    body = again.look()
    assert (body["state"], body["tracks"]) == (STILL, 40)
    assert reference_of(again).ready_at == learned.ready_at
    assert again.look() == body  # nothing new: nothing is written
    assert len(again.http.get("/cameras/corner/pose/history").json()["items"]) == 1


def test_an_estimate_that_a_reset_overtakes_is_dropped(known):
    known.walk(KNOCKED, 30)
    context = known.context
    with context.store.read() as session:
        evidence = load_evidence(session, context.settings, "corner")
    finding = compute_estimate(evidence, 0)
    known.http.post("/cameras/corner/reference/reset").raise_for_status()
    with context.store.write() as session:
        stored = save_estimate(session, context.queue, context.settings, evidence, finding)
    assert stored is None
    assert known.pose()["reason"] == "0 of 60 people for the reference"
