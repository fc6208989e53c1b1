"""Many cameras of one tracker that move together are one alert."""

import re
import threading
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import delete, select
from sqlalchemy.exc import IntegrityError

from service.alerts.alerts import end_alert, open_alert
from service.reasons import as_said
from service.store import alerts, journal, webhooks
from service.store.alerts import AlertRecord
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.store.sources import Poster
from service.store.tracks import TrackRecord
from service.workers.upkeep import reconciliation
from tests.conftest import CAMERA, track
from tests.service.conftest import problem

DRIFT = {"tilt_deg": 3.0}


class Town:
    """Cameras `c0`, `c1`, ... of which a test says what becomes."""

    def __init__(self, http, settings):
        self.http, self.settings, self.store = http, settings, Store(settings)
        self.now = datetime.now(UTC)

    def build(self, count, source="bytetrack", first=0):
        for n in range(first, first + count):
            self.http.post("/cameras", json={**CAMERA, "id": f"c{n}"}).raise_for_status()
            start_s = self.now.timestamp() - 60
            body = {"source": source, "tracks": [track("1", start_s=start_s)]}
            self.http.post(f"/cameras/c{n}/tracks", json=body).raise_for_status()

    def moves(self, n, *, ago_min=0.0, kind="drift", severity="warning"):
        changed_at = self.now - timedelta(minutes=ago_min)
        with self.store.write() as session:
            camera_id = f"c{n}"
            open_alert(
                session,
                self.settings,
                camera_id,
                kind,
                severity,
                DRIFT,
                changed_at,
                reasons=as_said("far"),
            )

    def stops(self, n, kind="drift"):
        with self.store.write() as session:
            end_alert(session, f"c{n}", kind, "cleared")

    def alerts(self, **query):
        return self.http.get("/alerts", params=query).json()["items"]

    def group(self):
        (group,) = [alert for alert in self.alerts(state="firing") if alert["camera_id"] is None]
        return group

    def notified(self):
        with self.store.read() as session:
            found = [e.payload for e in journal.events_after(session, 0, 1000) if e.type == "alert"]
        return [(payload["camera_id"], payload["state"]) for payload in found]


@pytest.fixture
def town(http, settings):
    return Town(http, settings)


def test_the_third_of_five_makes_a_group_that_blames_the_tracker(town):
    town.build(5)
    town.moves(0, ago_min=50)
    town.moves(1, ago_min=10, kind="clock")
    assert len(town.alerts()) == 2
    town.moves(2, ago_min=30)
    group = town.group()
    assert (group["kind"], group["severity"], group["track_source"]) == (
        "many_moved",
        "critical",
        "bytetrack",
    )
    assert group["camera_ids"] == ["c0", "c1", "c2"]
    assert "the tracker or its clock" in group["reason"]
    assert "'bytetrack'" in group["reason"]
    assert datetime.fromisoformat(group["changed_at"]) == town.now - timedelta(minutes=50)
    members = town.alerts(group_id=group["id"])
    assert {alert["camera_id"] for alert in members} == {"c0", "c1", "c2"}
    assert {alert["track_source"] for alert in members} == {"bytetrack"}
    # The third is told of as the group alone.
    assert town.notified() == [("c0", "firing"), ("c1", "firing"), (None, "firing")]


def test_whoever_comes_later_joins_without_a_word(town):
    town.build(6)
    for n in range(4):
        town.moves(n)
    town.moves(0, severity="critical")
    group = town.group()
    assert group["camera_ids"] == ["c0", "c1", "c2", "c3"]
    assert "4 cameras" in group["reason"]
    assert group["reason_code"] == "moved_together"
    assert group["reason_values"] == {"cameras": 4, "track_source": "bytetrack"}
    assert town.notified() == [("c0", "firing"), ("c1", "firing"), (None, "firing")]


def test_two_or_a_minority_or_moves_at_other_times_are_no_group(town):
    town.build(7)
    for n in range(3):
        town.moves(n)  # three of seven
    town.build(3, source="other", first=10)
    town.moves(10)
    town.moves(11)  # two are a few, even of three
    town.build(3, source="third", first=20)
    for n, ago_min in ((20, 0), (21, 40), (22, 90)):
        town.moves(n, ago_min=ago_min)
    assert all(alert["group_id"] is None for alert in town.alerts())
    assert len(town.alerts()) == len(town.notified()) == 8
    town.moves(3)  # the fourth of seven
    assert town.group()["camera_ids"] == ["c0", "c1", "c2", "c3"]


def test_what_is_no_matter_of_the_tracker_makes_no_group(town):
    town.build(3)
    for n in range(3):
        town.moves(n, kind="tracker")
    assert all(alert["group_id"] is None for alert in town.alerts())


def test_another_incident_of_another_time_stays_by_itself_until_it_is_one(town):
    town.build(6)
    for n in range(3):
        town.moves(n, ago_min=300)
    for n in (3, 4):
        town.moves(n)
    assert town.group()["camera_ids"] == ["c0", "c1", "c2"]
    town.moves(5)
    assert town.group()["camera_ids"] == [f"c{n}" for n in range(6)]  # one is open for a source


def test_webhooks_hear_of_the_group_instead_of_its_members(town):
    town.build(5)
    hook = town.http.post("/webhooks", json={"url": "http://93.184.215.14/hook"}).json()
    for n in range(5):
        town.moves(n)
    log = town.http.get(f"/webhooks/{hook['id']}/deliveries").json()["items"]
    notified = [town.http.get(f"/deliveries/{item['id']}").json() for item in log[::-1]]
    bodies = [delivery["payload"]["data"] for delivery in notified]
    assert [body["camera_id"] for body in bodies] == ["c0", "c1", None]
    assert bodies[2]["camera_ids"] == ["c0", "c1", "c2"]
    with town.store.read() as session:
        # What an Alertmanager is told again and again while it fires.
        (audible,) = webhooks.audible(session, None, datetime.now(UTC))
        assert audible.id == town.group()["id"]


def test_it_ends_when_its_last_member_has(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    for n in (2, 0):
        town.stops(n)
    assert town.group()["state"] == "firing"
    town.stops(1)
    assert town.alerts(state="firing") == []
    group = next(alert for alert in town.alerts() if alert["camera_id"] is None)
    assert (group["state"], group["outcome"]) == ("resolved", "cleared")
    # The ends of those that were told of by themselves are told, that of the silent one is not.
    assert town.notified()[3:] == [("c0", "resolved"), ("c1", "resolved"), (None, "resolved")]


def test_resolving_it_resolves_its_members_the_same_way(town):
    town.build(4)
    for n in range(4):
        town.moves(n)
    url = f"/alerts/{town.group()['id']}"
    answer = {"outcome": "fixed", "note": "frame rate set right", "by": "Ada"}
    body = town.http.post(f"{url}/resolve", json=answer).json()
    assert (body["state"], body["outcome"]) == ("resolved", "fixed")
    found = {(a["state"], a["outcome"], a["note"], a["resolved_by"]) for a in town.alerts()}
    assert found == {("resolved", "fixed", "frame rate set right", "Ada")}
    assert len(town.alerts()) == 5
    assert [act["by"] for act in body["acts"]] == ["Ada"]
    problem(town.http.post(f"{url}/resolve", json=answer), 409, "conflict")
    town.moves(0)
    assert [alert["camera_id"] for alert in town.alerts(state="firing")] == ["c0"]


def test_it_takes_acknowledgement_and_silence_as_any_alert(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    url = f"/alerts/{town.group()['id']}"
    until = (town.now + timedelta(hours=1)).isoformat()
    town.http.post(f"{url}/acknowledge", json={"by": "Ada"}).raise_for_status()
    town.http.post(f"{url}/silence", json={"until": until}).raise_for_status()
    body = town.http.get(url).json()
    assert (body["acknowledged"], body["silenced"]) == (True, True)


def test_a_member_that_turns_from_drift_to_clock_stays_in_it(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    group_id = town.group()["id"]
    with town.store.write() as session:
        end_alert(session, "c2", "drift", "cleared", note="it is told as clock now")
        open_alert(
            session,
            town.settings,
            "c2",
            "clock",
            "warning",
            DRIFT,
            town.now,
            reasons=as_said("30 for 25"),
        )
    assert town.group()["id"] == group_id
    firing = town.alerts(state="firing", camera_id="c2")
    assert [(alert["kind"], alert["group_id"]) for alert in firing] == [("clock", group_id)]


def test_one_whose_cameras_are_gone_ends(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    for n in range(3):
        town.http.delete(f"/cameras/c{n}", headers={"If-Match": "*"}).raise_for_status()
    (group,) = town.alerts()
    assert (group["state"], group["outcome"]) == ("resolved", "camera_removed")


def test_one_that_lost_its_members_is_ended_by_the_reconcile(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    with town.store.write() as session:
        session.execute(delete(CameraRecord))  # as nobody does over HTTP
    with town.store.write() as session:
        reconciliation.reconcile_alerts(session)
    (group,) = town.alerts()
    assert (group["state"], group["outcome"]) == ("resolved", "cleared")


def test_cameras_that_got_nothing_for_a_day_do_not_count(town):
    town.build(9)
    with town.store.write() as session:
        gone = select(TrackRecord).where(TrackRecord.camera_id.in_(["c6", "c7", "c8"]))
        for record in session.scalars(gone):
            record.received_at -= timedelta(days=2)
    for n in range(3):
        town.moves(n)  # of the six that are left
    assert town.group()["camera_ids"] == ["c0", "c1", "c2"]


def test_one_is_open_for_a_source_whatever_happens(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    with town.store.write() as session:
        group = alerts.firing_group(session, Poster(source="bytetrack", token_id=""), "many_moved")
        values = {c.key: getattr(group, c.key) for c in AlertRecord.__mapper__.column_attrs}
        session.add(AlertRecord(**values | {"id": "b" * 32}))
        with pytest.raises(IntegrityError, match="UNIQUE.*alerts.poster_id|uq_alerts_firing_group"):
            session.flush()
        session.rollback()


def test_cameras_that_alarm_at_the_same_moment_make_one_group(town):
    town.build(8)
    threads = [threading.Thread(target=town.moves, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(town.alerts(state="firing")) == 9
    assert town.group()["camera_ids"] == [f"c{n}" for n in range(8)]
    assert sum(camera is None for camera, _ in town.notified()) == 1


def test_cameras_that_fall_silent_together_are_one_alert_of_their_own_kind(town):
    town.build(4)
    town.moves(3)
    for n in range(3):
        town.moves(n, kind="no_data")
    group = town.group()
    assert (group["kind"], group["camera_ids"]) == ("many_silent", ["c0", "c1", "c2"])
    assert "fell silent together" in group["reason"]
    assert town.alerts(camera_id="c3")[0]["group_id"] is None


def test_its_pages_have_words_of_its_own_and_its_members_lead_to_it(town):
    """It was filed and answered as a clock, and each member had buttons of its own."""
    town.build(3)
    for n in range(3):
        town.moves(n)
    group = town.group()
    parts = town.http.get("/ui/alerts").text.split('<li class="alert-row"')[1:]
    rows = [part.split("</li>")[0] for part in parts]
    (own,) = [row for row in rows if f'data-id="{group["id"]}"' in row]
    assert re.findall(r'data-outcome="(\w+)"', own) == ["fixed", "false_alarm"]
    assert "Many moved" in own
    assert "Clock" not in own
    assert "The tracker, its clock or frame rate is as it should be." in own
    filed = town.http.get("/ui/alerts?kind=clock").text
    assert group["id"] not in filed
    assert group["id"] in town.http.get("/ui/alerts?kind=many_moved").text
    there = f'href="/ui/alerts?kind=many_moved&amp;kind=many_silent#alert-{group["id"]}"'
    members = [row for row in rows if row is not own]
    assert len(members) == 3
    for row in members:
        assert there in row.replace("&kind", "&amp;kind")
        assert "<button" not in row
        assert 'class="pick"' not in row
    page = town.http.get("/ui/cameras/c0").text
    assert there in page.replace("&kind", "&amp;kind")
    assert "It is answered with 3 cameras of bytetrack" in page
    assert "<summary>This camera apart</summary>" in page
    (line,) = [e for e in town.http.get("/ui/fleet/index").json()["cameras"] if e[0] == "c0"]
    assert line[9] == "member"


def test_who_hears_of_moves_alone_hears_of_a_group_that_speaks_for_them(town):
    town.build(3)
    for kind, count in (("drift", 3), ("no_data", 0)):
        body = {"url": f"http://93.184.215.14/{kind}", "kinds": [kind]}
        hook = town.http.post("/webhooks", json=body).json()["id"]
        with town.store.read() as session:
            before = len(webhooks.audible(session, [kind], datetime.now(UTC)))
        assert before == 0
        if count:
            for n in range(count):
                town.moves(n)
        log = town.http.get(f"/webhooks/{hook}/deliveries").json()["items"]
        assert len(log) == count  # two of cameras, and the group
        with town.store.read() as session:
            told = webhooks.audible(session, [kind], datetime.now(UTC))
        assert [each.kind for each in told] == (["many_moved"] if count else [])


def test_what_came_of_it_is_what_came_of_most_members(town):
    town.build(3)
    for n in range(3):
        town.moves(n)
    for n in (0, 1):
        town.http.post(f"/cameras/c{n}/pose/put-back").raise_for_status()
    (last,) = [each for each in town.alerts(state="firing") if each["camera_id"] == "c2"]
    answer = {"outcome": "false_alarm"}
    town.http.post(f"/alerts/{last['id']}/resolve", json=answer).raise_for_status()
    group = next(alert for alert in town.alerts() if alert["camera_id"] is None)
    assert (group["state"], group["outcome"]) == ("resolved", "put_back")
