"""Between full estimates of a stationary camera, new tracks update the monitor alone."""

import pytest

from service.store import estimates
from service.store.cameras import CameraRecord
from tests.service.street import KNOCKED, PRIOR, known_street


@pytest.fixture
def stationary(http, settings):
    """A stationary camera with a reference of 100 tracks and a window of 120."""
    street = known_street(http, settings, 100)
    street.keep_to_lanes(PRIOR, 120)
    body = street.look(full=True)
    assert (body["state"], body["tracks"]) == ("ok", 120)
    assert body["moved"] < 0.1
    return street


def count(street):
    with street.context.store.read() as session:
        return estimates.count(session, "corner")


def test_few_new_tracks_are_monitored_without_a_full_estimate(stationary):
    before = stationary.pose()
    stationary.keep_to_lanes(PRIOR, 5)
    body = stationary.look()
    assert body["updated_at"] == before["updated_at"]
    assert body["checked_at"] > before["checked_at"]
    assert body["tracks"] == 120
    stationary.keep_to_lanes(PRIOR, 9)  # 14 of 134: a tenth of the window is new
    body = stationary.look()
    assert body["updated_at"] > before["updated_at"]
    assert body["tracks"] == 134


def test_run_without_new_tracks_keeps_checked_at(stationary):
    before = stationary.pose()
    assert stationary.look() == before


def test_open_page_gets_a_full_estimate_with_the_next_track(stationary):
    before = stationary.pose()
    stationary.http.get("/ui/cameras/corner").raise_for_status()
    stationary.keep_to_lanes(PRIOR, 1)
    body = stationary.look()
    assert body["updated_at"] > before["updated_at"]
    assert body["tracks"] == 121
    with stationary.context.store.read() as session:
        assert not session.get_one(CameraRecord, "corner").full_estimate_asked


def test_operators_answer_is_followed_by_a_full_estimate(stationary):
    before = stationary.pose()
    stationary.http.post("/cameras/corner/reference/reset").raise_for_status()
    stationary.keep_to_lanes(PRIOR, 5)
    assert stationary.look()["updated_at"] != before["updated_at"]


def test_move_raises_an_alert_before_a_tenth_of_a_long_window_is_new(http, settings):
    street = known_street(http, settings, 100)
    street.keep_to_lanes(PRIOR, 380)
    street.look(full=True)
    posted = 0
    while not street.alerts(state="firing", kind="drift") and posted < 60:
        street.keep_to_lanes(KNOCKED, 4)
        posted += 4
        street.look()
    assert posted <= 40  # 5 deg of tilt, 4 of roll
