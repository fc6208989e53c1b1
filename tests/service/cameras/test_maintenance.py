"""Maintenance windows: what is seen in them is not judged, and nobody is told."""

from datetime import UTC, datetime, timedelta

import pytest

from service.alerts.alerts import open_alert
from service.estimation.anchoring import LearnedPaths
from service.estimation.growth import load_growth, save_growth
from service.estimation.learning import load_reference_period
from service.reasons import as_said
from service.references import window_of
from service.store import references, tracks, windows
from service.workers.upkeep.retention import limits_of_camera
from tests.conftest import track
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem

URL = "/cameras/corner/maintenance"


def at(ago_h):
    return (datetime.now(UTC) - timedelta(hours=ago_h)).isoformat()


def begin(http, from_h=None, to_h=-1.0, **more):
    body = {"to": at(to_h), **more} | ({} if from_h is None else {"from": at(from_h)})
    answer = http.post(URL, json=body)
    assert answer.status_code == 201, answer.text
    return answer.json()


def put(http, first, count, ago_h):
    """Tracks that begin a second after the other, so many hours ago."""
    start_s = datetime.fromisoformat(at(ago_h)).timestamp()
    batch = [track(str(n), start_s=start_s + n - first) for n in range(first, first + count)]
    http.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()


def test_a_window_begins_now_and_is_listed_with_its_state(corner):
    first = begin(corner, reason="new lens", by="Ada")
    assert (first["state"], first["reason"], first["by"]) == ("under_way", "new lens", "Ada")
    begin(corner, from_h=-5, to_h=-6)
    begin(corner, from_h=3, to_h=2)
    states = [window["state"] for window in corner.get(URL).json()["items"]]
    assert states == ["over", "under_way", "planned"]


@pytest.mark.parametrize(
    ("body", "pointer", "words"),
    [
        ({"from": at(1), "to": at(2)}, "/to", "after its beginning"),
        ({"to": at(0.1)}, "/to", "after its beginning"),
        ({"to": at(-31 * 24)}, "/to", "at most 30 days"),
        ({"from": at(400 * 24), "to": at(399 * 24)}, "/from", "at most 366 days"),
        ({"to": "2030-01-01T00:00:00"}, "/to", "with a zone"),
    ],
)
def test_times_that_make_no_window_are_refused(corner, body, pointer, words):
    document = problem(corner.post(URL, json=body), 422, "malformed")
    assert document["errors"][0]["pointer"] == pointer
    assert words in document["errors"][0]["reason"]
    assert corner.get(URL).json()["items"] == []


def test_it_is_ended_early_taken_back_or_moved(corner):
    window = begin(corner, from_h=2)
    url = f"{URL}/{window['id']}"
    body = corner.patch(url, json={"to": at(1)}).json()  # forgotten: it ended an hour ago
    assert body["state"] == "over"
    problem(corner.delete(url), 409, "conflict")
    problem(corner.patch(url, json={"to": at(3)}), 422, "malformed")
    assert corner.patch(url, json={"to": at(-1)}).json()["state"] == "under_way"
    assert corner.delete(url, params={"by": "Ada"}).status_code == 204
    entries = corner.get("/activity").json()["items"]
    assert ("maintenance.ended", "Ada") in [(each["what"], each["by"]) for each in entries]
    (left,) = corner.get(URL).json()["items"]
    assert (left["id"], left["state"]) == (window["id"], "over")
    late = corner.patch(url, json={"from": at(-0.5)})  # after it was ended, before it would have
    assert problem(late, 422, "malformed")["errors"][0]["pointer"] == "/to"
    planned = begin(corner, from_h=-1, to_h=-2)
    assert corner.delete(f"{URL}/{planned['id']}").status_code == 204
    assert len(corner.get(URL).json()["items"]) == 1
    for path in (f"{URL}/none", f"/cameras/nowhere/maintenance/{window['id']}"):
        problem(corner.patch(path, json={}), 404, "not_found")
        problem(corner.delete(path), 404, "not_found")
    problem(corner.get("/cameras/nowhere/maintenance"), 404, "not_found")


def test_no_alert_opens_while_it_lasts_and_the_pose_says_why(bench):
    bench.see(PRIOR)
    begin(bench.http, reason="new lens")
    assert bench.see(moved(tilt_deg=5.0)) is None  # of before the window: judged no more
    assert bench.alerts() == []
    body = bench.pose()
    assert body["reason"].startswith("maintenance is under way until 20")
    assert "(new lens); " in body["reason"]
    assert body["state"] == "ok"  # as the last estimate had it


def test_a_window_that_is_planned_changes_nothing_yet(bench):
    for _ in range(2):
        bench.see(moved(tilt_deg=5.0))
    begin(bench.http, from_h=-1, to_h=-2)
    assert bench.pose()["reason"].startswith("tilt")
    assert bench.see(moved(tilt_deg=5.0)).state == "drifting"
    assert len(bench.alerts(state="firing")) == 1


def test_an_open_alert_is_told_neither_anew_nor_as_grown_until_it_is_over(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=1.5))
    told = bench.events("alert")
    window = begin(bench.http, from_h=48)
    with bench.store.write() as session:
        # What was judged before the window was told of is stored while it lasts.
        open_alert(
            session, bench.settings, "corner", "drift", "critical", {}, None, reasons=as_said("far")
        )
        open_alert(
            session, bench.settings, "corner", "clock", "warning", {}, None, reasons=as_said("far")
        )
    (alert,) = bench.alerts()
    assert alert["severity"] == "warning"
    assert bench.events("alert") == told
    bench.http.patch(f"{URL}/{window['id']}", json={"to": at(1.1)}).raise_for_status()
    bench.see(moved(tilt_deg=5.0))
    assert bench.events("alert")[-1]["severity"] == "critical"


def test_after_it_the_camera_is_judged_by_what_came_after_it(bench):
    bench.see(PRIOR)
    bench.clock_s = datetime.now(UTC).timestamp() - 1800
    begin(bench.http, from_h=0.9, to_h=0.5)
    body = bench.pose()
    assert (body["state"], body["estimated"]) == ("learning", [])
    assert "0 tracks since the maintenance" in body["reason"]
    for _ in range(3):
        record = bench.see(moved(tilt_deg=5.0), people=6)
    assert (record.tracks, record.state) == (18, "drifting")
    (alert,) = bench.alerts(state="firing")
    assert alert["kind"] == "drift"


def test_tracks_of_a_window_are_in_no_window_of_an_estimate(bench):
    put(bench.http, 0, 6, ago_h=0.9)
    put(bench.http, 6, 6, ago_h=0.6)
    put(bench.http, 12, 6, ago_h=0.3)
    begin(bench.http, from_h=0.7, to_h=0.4)
    with bench.store.read() as session:
        reference = references.newest(session, "corner")
        window = windows.window(session, window_of(session, reference, bench.settings))
        assert [record.track_id for record in window] == [str(n) for n in range(12, 18)]
        assert tracks.counts(session, ["corner"]) == {"corner": 18}  # they stay stored


def test_nor_in_a_reference_that_is_being_learned(corner, settings, bench):
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    few = bench.settings
    bench.http.patch(
        "/cameras/corner", json={"reference_tracks": 10}, headers={"If-Match": "*"}
    ).raise_for_status()
    put(bench.http, 0, 6, ago_h=0.9)
    put(bench.http, 6, 6, ago_h=0.6)
    begin(bench.http, from_h=0.7, to_h=0.55)
    begin(bench.http, from_h=0.58, to_h=0.5)  # overlapping ones are one
    assert bench.pose()["reason"].startswith("6 of 10 people for the reference")
    with bench.store.read() as session:
        period = load_reference_period(session, few, "corner")
        assert (period.enough, len(period.trajectories)) == (False, 6)
    put(bench.http, 12, 4, ago_h=0.3)
    now = begin(bench.http)
    with bench.store.read() as session:
        assert load_reference_period(session, few, "corner") is None  # not while somebody is there
    bench.http.patch(f"{URL}/{now['id']}", json={"from": at(0.1), "to": at(0.05)})
    with bench.store.read() as session:
        period = load_reference_period(session, few, "corner")
        assert len(period.trajectories) == 10
        assert period.to_s > datetime.fromisoformat(at(0.3)).timestamp()


def test_nor_in_a_flow_map_that_grows(bench):
    grows = bench.settings.model_copy(update={"flow_unsure_tracks": 0})
    put(bench.http, 1000, 60, ago_h=0.9)
    put(bench.http, 2000, 60, ago_h=0.6)
    bench.clock_s = datetime.now(UTC).timestamp() - 600
    window = begin(bench.http, from_h=0.7, to_h=0.5)
    with bench.store.read() as session:
        assert load_growth(session, grows, "corner") is None  # who knows how it stands since
    bench.see(PRIOR, people=10)
    with bench.store.read() as session:
        period = load_growth(session, grows, "corner")
        assert len(period.trajectories) == 60  # the window is of the 10
    bench.http.patch(f"{URL}/{window['id']}", json={"from": at(0.51)}).raise_for_status()
    with bench.store.read() as session:
        assert len(load_growth(session, grows, "corner").trajectories) == 120


def test_a_window_told_of_late_has_the_map_learned_without_it(bench):
    grows = bench.settings.model_copy(update={"flow_unsure_tracks": 0})
    put(bench.http, 1000, 60, ago_h=0.9)
    bench.see(PRIOR, people=20)
    with bench.store.write() as session:
        period = load_growth(session, grows, "corner")
        assert save_growth(session, "corner", period, LearnedPaths(flow=b"a map", chart=None))
        assert load_growth(session, grows, "corner") is None
    begin(bench.http, from_h=0.95, to_h=0.85)
    bench.clock_s = datetime.now(UTC).timestamp() - 600
    bench.see(PRIOR, people=10, paths=True)
    with bench.store.read() as session:
        period = load_growth(session, grows, "corner")
        assert (len(period.trajectories), period.spoilt) == (20, True)


def test_windows_are_kept_as_long_as_their_tracks(bench):
    begin(bench.http, from_h=24 * 32, to_h=24 * 31)
    begin(bench.http, from_h=24 * 32, to_h=24 * 29)
    with bench.store.write() as session:
        for limit in limits_of_camera(bench.settings, "corner"):
            limit.bite(session)
        (left,) = references.maintenance_of(session, "corner")
    assert left.to_at > datetime.now(UTC) - timedelta(days=30)
    bench.http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    with bench.store.read() as session:
        assert references.maintenance_of(session, "corner") == []
