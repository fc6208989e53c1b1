"""What one source posts for a camera cannot move another's pose, reference or window."""

from datetime import UTC, datetime, timedelta

import pytest

from service.store import references, sources, tracks
from service.workers.upkeep import reconciliation
from service.workers.upkeep.retention import limits_of_camera
from tests.conftest import CAMERA, track
from tests.service.conftest import problem
from tests.service.street import KNOCKED, PRIOR, Street

WANTED = 40
URL = "/cameras/corner/sources"


class Trackers(Street):
    """A street that several trackers watch."""

    source = "tracker-1.2"

    def reconcile(self):
        with self.context.store.write() as session:
            reconciliation.reconcile_camera(
                session, self.context.queue, self.context.settings, "corner"
            )

    def silence(self, name, hours):
        """Have a source posted for the last time so long ago."""
        with self.context.store.write() as session:
            sources.find(session, "corner", name).last_seen_at -= timedelta(hours=hours)

    def sources(self):
        return {each["name"]: each for each in self.http.get(URL).json()["items"]}

    def reference(self):
        with self.context.store.read() as session:
            return references.newest(session, "corner")


@pytest.fixture
def known(learned):
    """A camera that has been learned of the first source's people, and is well."""

    def make(http, settings):
        http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
        street = Trackers(http, settings)
        street.clock_s -= 40_000
        street.keep_to_lanes(PRIOR, WANTED + 10)
        assert street.look()["state"] == "ok"
        return street

    return learned("sources", make)


def test_the_first_source_to_post_counts(known):
    (only,) = known.sources().values()
    assert (only["name"], only["counts"], only["tracks"]) == ("tracker-1.2", True, WANTED + 10)
    assert known.reference().source == "tracker-1.2"
    known.reconcile()
    assert known.alerts() == []


def served(body):
    return {name: value for name, value in body.items() if name != "checked_at"}


def test_another_source_moves_nothing_and_is_told(known):
    before, reference = known.pose(), known.reference()
    known.source = "stranger"
    known.keep_to_lanes(KNOCKED, WANTED + 20)
    known.look()
    assert served(known.pose()) == served(before)
    known.reconcile()
    known.look()
    assert served(known.pose()) == served(before)
    page = known.http.get("/ui/cameras/corner").text
    assert 'data-action="use-source" data-source="stranger"' in page
    assert "tracker-1.2</strong>: its tracks count" in page
    after = known.reference()
    assert (after.id, after.data, after.source) == (reference.id, reference.data, "tracker-1.2")
    (alert,) = known.alerts(state="firing")
    assert (alert["kind"], alert["severity"]) == ("tracker", "warning")
    assert "'stranger'" in alert["reason"]
    assert "'tracker-1.2' fall silent for 6 h" in alert["reason"]
    answer = {"outcome": "false_alarm"}
    known.http.post(f"/alerts/{alert['id']}/resolve", json=answer).raise_for_status()
    known.reconcile()
    assert known.alerts(state="firing") == []  # it was told once
    known.source = "tracker-1.2"
    known.keep_to_lanes(PRIOR, 5)
    assert known.look()["tracks"] == 15


def test_another_source_moves_nothing_while_the_first_is_learned(http, settings):
    http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
    street = Trackers(http, settings)
    street.walk(PRIOR, 10)
    street.source = "stranger"
    street.walk(KNOCKED, WANTED)
    assert street.look()["reason"] == f"10 of {WANTED} people for the reference"


def test_an_update_of_the_detector_takes_over_once_the_old_one_is_silent(known):
    known.clock_s += 7 * 3600
    known.source = "tracker-1.3"
    known.keep_to_lanes(PRIOR, WANTED - 1)
    known.reconcile()
    known.silence("tracker-1.2", 7)
    known.reconcile()
    assert known.reference().source == "tracker-1.2"  # a track is missing
    assert known.sources()["tracker-1.3"]["usable_tracks"] == WANTED - 1
    known.keep_to_lanes(PRIOR, 11)
    known.reconcile()
    assert known.reference().source == "tracker-1.3"
    body = known.look()
    assert (body["state"], body["tracks"]) == ("ok", pytest.approx(10, abs=1))
    assert known.reference().origin == "source"
    (alert,) = known.alerts()
    assert (alert["state"], alert["outcome"]) == ("resolved", "cleared")
    assert known.sources()["tracker-1.3"]["counts"]


@pytest.mark.slow
def test_it_does_not_take_over_where_the_camera_is_in_doubt(known):
    known.keep_to_lanes(KNOCKED, 40)
    assert known.look()["state"] == "drifting"
    known.clock_s += 7 * 3600
    known.source = "tracker-1.3"
    known.keep_to_lanes(KNOCKED, WANTED + 10)
    known.silence("tracker-1.2", 7)
    known.reconcile()
    assert known.reference().source == "tracker-1.2"
    assert known.look()["state"] == "drifting"


@pytest.mark.slow
def test_two_trackers_that_both_post_stay_beside_each_other(known):
    known.source = "tracker-1.3"
    known.keep_to_lanes(PRIOR, WANTED + 10)
    known.silence("tracker-1.2", 7)  # it posts once a day: of the same hours
    known.reconcile()
    assert known.reference().source == "tracker-1.2"


def test_a_person_says_at_once_which_one_counts(known):
    known.source = "lidar/7"
    known.keep_to_lanes(PRIOR, WANTED + 10)
    body = known.http.post(f"{URL}/lidar/7/use", json={"by": "Ada"}).json()
    assert {each["name"]: each["counts"] for each in body["items"]} == {
        "tracker-1.2": False,
        "lidar/7": True,
    }
    assert known.reference().requested_by == "Ada"
    body = known.look()
    assert (body["state"], body["tracks"]) == ("ok", pytest.approx(10, abs=1))
    problem(known.http.post(f"{URL}/nobody/use"), 404, "not_found")
    problem(known.http.delete(f"{URL}/lidar/7"), 409, "conflict")
    assert known.http.delete(f"{URL}/tracker-1.2").status_code == 204
    assert list(known.sources()) == ["lidar/7"]
    with known.context.store.read() as session:
        assert tracks.counts(session, ["corner"]) == {"corner": WANTED + 10}


def test_the_source_that_a_person_turned_down_is_no_alert(known):
    """A mirror of the alert that the person answered opened in the same second."""
    known.source = "lidar/7"
    known.keep_to_lanes(PRIOR, 3)
    known.reconcile()
    assert [alert["kind"] for alert in known.alerts(state="firing")] == ["tracker"]
    known.http.post(f"{URL}/lidar/7/use", json={"by": "Ada"}).raise_for_status()
    for source in ("tracker-1.2", "lidar/7"):
        known.source = source
        known.keep_to_lanes(PRIOR, 3)
        known.reconcile()
        assert known.alerts(state="firing") == []


def test_after_a_reset_the_same_source_counts(known):
    known.http.post("/cameras/corner/reference/reset").raise_for_status()
    assert known.reference().source == "tracker-1.2"


def test_names_at_random_do_not_fill_the_table(corner):
    def post(name):
        body = {"source": name, "tracks": [track("1")]}
        return corner.post("/cameras/corner/tracks", json=body)

    for number in range(16):
        assert post(f"s{number}").status_code == 202
    document = problem(post("one more"), 409, "too_many_sources")
    assert "at most 16 a camera" in document["detail"]
    assert post("s3").json()["duplicates"] == 1
    assert corner.delete(f"{URL}/s5").status_code == 204
    assert post("one more").status_code == 202


def test_a_source_cannot_post_another_ones_tracks_away(corner, settings):
    limited = settings.model_copy(update={"keep_tracks": 10})
    street = Trackers(corner, limited)
    for name in ("first", "second"):
        street.source = name
        street.walk(PRIOR, 12)
    with street.context.store.write() as session:
        assert next(limits_of_camera(limited, "corner")).bite(session) == 4
        assert sources.count_from(session, "corner", "first", None, ()) == 10
        assert sources.find(session, "corner", "first").last_seen_at < datetime.now(UTC)
