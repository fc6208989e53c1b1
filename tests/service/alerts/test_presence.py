"""A camera that falls silent: `no_data` by its own rhythm, as a state and as an alert."""

import math
import time
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from pydantic import ValidationError
from sqlalchemy import delete

from service.alerts.arrival_models import (
    arrival_model_of,
    compute_arrival_model,
    load_arrivals,
    save_arrival_model,
)
from service.alerts.data_gaps import data_gap_of, watch_data_gap
from service.settings import Settings
from service.store import references
from service.store.cameras import RhythmRecord
from service.store.tracks import TrackRecord, pack
from service.wording.reasons import in_words
from service.workers.context import JobContext
from service.workers.upkeep import reconciliation
from service.workers.upkeep.periodic import run_arrival_models
from tests.conftest import track
from tests.service.bench import PRIOR

DAY_S, HOUR_S = 86_400.0, 3600.0
DAYS = 14
MIDNIGHT_S = math.floor(time.time() / DAY_S) * DAY_S - DAY_S  # of yesterday


class Street:
    """The camera `corner`, which sees somebody every 5 minutes from 8 to 20, for two weeks.

    `people` may be told when to stop and how late its tracks are stored.
    """

    def __init__(self, bench):
        self.bench, self.store, self.settings = bench, bench.store, bench.settings

    def people(self, until_s=MIDNIGHT_S, late_s=lambda at_s: 2.0, zone_s=0.0):
        points = pack(np.array([[0.0, 1.0, 1.0]]))
        with self.store.write() as session:
            for at_s in np.arange(MIDNIGHT_S - DAYS * DAY_S, until_s, 300):
                if 8 <= (at_s % DAY_S) / HOUR_S < 20:
                    stored_at = datetime.fromtimestamp(at_s + late_s(at_s), UTC)
                    session.add(
                        TrackRecord(
                            camera_id="corner",
                            source="unnamed",
                            track_id=str(at_s),
                            started_s=at_s + zone_s - 8,
                            ended_s=at_s + zone_s,
                            points=points,
                            received_at=stored_at,
                        )
                    )

    def learns(self, at_s=MIDNIGHT_S):
        now = datetime.fromtimestamp(at_s, UTC)
        with self.store.write() as session:
            arrivals = load_arrivals(session, "corner", now)
            rhythm, counts = compute_arrival_model(arrivals, self.settings, now)
            save_arrival_model(session, "corner", rhythm, counts, now)
        return rhythm

    def silence(self, hours, day_s=MIDNIGHT_S):
        """What is made of the silence at an hour of a day."""
        now = datetime.fromtimestamp(day_s + hours * HOUR_S, UTC)
        with self.store.read() as session:
            return data_gap_of(session, self.settings, "corner", now)

    def watch(self, at):
        with self.store.write() as session:
            return watch_data_gap(session, self.settings, "corner", at)

    def post(self, track_id, ago_s=10.0):
        body = {"tracks": [track(track_id, start_s=time.time() - ago_s)]}
        self.bench.http.post("/cameras/corner/tracks", json=body).raise_for_status()


@pytest.fixture
def street(bench):
    return Street(bench)


def noon_outage(street, **how):
    """Two weeks and half a day of people; then nobody from noon on."""
    street.people(until_s=MIDNIGHT_S + 12 * HOUR_S, **how)
    street.learns(MIDNIGHT_S + 12 * HOUR_S)


def test_a_night_ends_in_no_data_and_in_no_alert_by_morning(street):
    street.people()
    street.learns()
    evening = street.silence(-3.9)  # 11 minutes after the last
    assert (evening.no_data, evening.severity) == (False, None)
    night = street.silence(3.92)
    assert (night.no_data, night.severity) == (True, None)
    assert in_words(night.reasons) == "no track for 8.0 h, as is usual at this hour"
    for hours in np.arange(-3.9, 8.3, 0.1):
        found = street.silence(hours)
        assert found is None or found.severity is None


def test_an_outage_at_noon_is_an_alert_within_hours(street):
    noon_outage(street)
    assert street.silence(12.05) is None  # nobody for less than 10 minutes
    assert street.silence(12.5).severity is None
    found = street.silence(15.5)
    assert (found.severity, found.no_data) == ("warning", True)
    assert "no track for 3.6 h, where about 4" in in_words(found.reasons)
    later = street.silence(37)
    assert later.severity == "critical"


def test_it_is_opened_once_and_ends_when_tracks_come_again(street):
    noon_outage(street)
    at = datetime.fromtimestamp(MIDNIGHT_S + 15.5 * HOUR_S, UTC)
    assert street.watch(at) == "no tracks come"
    assert street.watch(at) is None
    (alert,) = street.bench.alerts()
    assert (alert["kind"], alert["severity"], alert["drift"]) == ("no_data", "warning", {})
    changed = datetime.fromisoformat(alert["changed_at"]).timestamp()
    assert changed == pytest.approx(MIDNIGHT_S + 12 * HOUR_S - 300)
    assert street.watch(at + timedelta(hours=22)) == "no tracks come"
    assert street.bench.alerts()[0]["severity"] == "critical"
    assert street.watch(at + timedelta(hours=22)) is None
    assert street.watch(at) is None  # it does not shrink
    street.post("back")
    assert street.watch(datetime.now(UTC)) == "tracks come again"
    (alert,) = street.bench.alerts()
    assert (alert["state"], alert["outcome"]) == ("resolved", "cleared")
    told = [(event["state"], event["severity"]) for event in street.bench.events("alert")]
    assert told == [("firing", "warning"), ("firing", "critical"), ("resolved", "critical")]


def test_a_person_who_ends_it_is_not_asked_again_until_a_silence_of_its_own(street):
    noon_outage(street)
    street.watch(datetime.fromtimestamp(MIDNIGHT_S + 15.5 * HOUR_S, UTC))
    url = f"/alerts/{street.bench.alerts()[0]['id']}/resolve"
    street.bench.http.post(url, json={"outcome": "false_alarm"}).raise_for_status()
    now = datetime.now(UTC)
    assert street.watch(now) is None
    assert street.watch(now + timedelta(minutes=15)) is None
    assert street.watch(now + timedelta(hours=24)) == "no tracks come"  # a day of people missed


def test_none_opens_during_maintenance_and_the_time_of_it_does_not_count(street):
    noon_outage(street)
    now = datetime.now(UTC)
    http, url = street.bench.http, "/cameras/corner/maintenance"
    body = {"to": (now + timedelta(hours=1)).isoformat()}
    window = http.post(url, json=body).json()
    assert street.watch(now + timedelta(days=2)) is None
    http.delete(f"{url}/{window['id']}").raise_for_status()
    assert street.watch(datetime.now(UTC) + timedelta(minutes=9)) is None
    assert street.watch(datetime.now(UTC) + timedelta(hours=24)) == "no tracks come"


def test_tracks_that_are_posted_by_the_night_are_waited_for(street):
    def at_two(at_s):
        return math.ceil(at_s / DAY_S) * DAY_S + 2 * HOUR_S - at_s

    street.people(late_s=at_two)
    rhythm = street.learns(MIDNIGHT_S + 3 * HOUR_S)
    assert rhythm.delay_s == pytest.approx(18 * HOUR_S + 2 * HOUR_S)
    for hours in (12, 20, 25):
        found = street.silence(hours)
        assert (found.severity, "come up to 20.0 h late" in in_words(found.reasons)) == (None, True)
    # Nothing was posted at two in the morning, nor later: then it is.
    assert [street.silence(hours).severity for hours in (27, 30)] == [None, None]
    assert street.silence(39).severity == "warning"


def test_a_clock_that_is_behind_is_no_silence(street):
    street.people(until_s=MIDNIGHT_S + 12 * HOUR_S, zone_s=-3 * HOUR_S)
    rhythm = street.learns(MIDNIGHT_S + 12 * HOUR_S)
    assert rhythm.delay_s == pytest.approx(1.5 * (3 * HOUR_S + 2), rel=1e-3)
    found = street.silence(12.1)
    assert (found.no_data, found.severity) == (False, None)
    assert street.silence(18).severity == "warning"


def test_without_a_rhythm_the_fixed_limit_counts(street):
    street.people(until_s=MIDNIGHT_S - 10 * DAY_S)
    assert street.learns() is None  # four days
    quiet = street.silence(0, day_s=MIDNIGHT_S - 10 * DAY_S + 19 * HOUR_S)
    assert (quiet.no_data, quiet.severity) == (False, None)
    found = street.silence(0, day_s=MIDNIGHT_S - 10 * DAY_S + 21 * HOUR_S)
    assert (found.no_data, found.severity) == (True, "warning")
    assert "up to 24 h are waited for" in in_words(found.reasons)


def test_what_was_recorded_long_ago_and_posted_just_now_is_old_but_no_alarm(street):
    street.post("old", ago_s=40 * DAY_S)
    with street.store.read() as session:
        found = data_gap_of(session, street.settings, "corner", datetime.now(UTC))
    assert (found.no_data, found.severity) == (True, None)
    assert street.watch(datetime.now(UTC)) is None
    assert street.watch(datetime.now(UTC) + timedelta(hours=25)) == "no tracks come"


def test_a_camera_that_never_saw_anybody_is_learning(street):
    assert street.watch(datetime.now(UTC) + timedelta(days=9)) is None
    assert street.bench.pose()["state"] == "learning"


def test_the_served_pose_is_no_data_in_words(street):
    street.bench.see(PRIOR)
    assert street.bench.pose()["state"] == "ok"  # an hour ago, of a camera not known yet
    with street.store.write() as session:
        session.execute(delete(TrackRecord))
    street.people()
    street.learns()
    body = street.bench.pose()
    assert body["state"] == "no_data"
    assert body["reason"].startswith("no track for ")
    assert body["estimated"]  # what was told last is still served


def test_the_reconcile_watches(street):
    street.people(until_s=MIDNIGHT_S - DAY_S)
    street.learns()
    with street.store.write() as session:
        found = reconciliation.reconcile_camera(
            session, street.bench.queue, street.settings, "corner"
        )
    assert "no tracks come" in found
    assert street.bench.alerts()[0]["kind"] == "no_data"


def test_counts_outlive_their_tracks(street):
    street.people()
    before = street.learns()
    with street.store.write() as session:
        session.execute(delete(TrackRecord).where(TrackRecord.ended_s < MIDNIGHT_S - 2 * DAY_S))
    after = street.learns(MIDNIGHT_S + 2 * HOUR_S)
    assert after.rhythm.rates == before.rhythm.rates
    assert after.rhythm.rates[12] == pytest.approx(12)
    assert after.delay_s == pytest.approx(3.0)
    with street.store.read() as session:
        assert arrival_model_of(session, "corner") == after
        assert len(session.get(RhythmRecord, "corner").counts["tracks"]) == DAYS * 12


@pytest.mark.parametrize(("outcome", "rate"), [("fixed", 12.0), ("false_alarm", 11.5)])
def test_an_outage_is_not_learned_as_a_habit(street, outcome, rate):
    noon_outage(street)
    street.watch(datetime.fromtimestamp(MIDNIGHT_S + 15.5 * HOUR_S, UTC))
    url = f"/alerts/{street.bench.alerts()[0]['id']}/resolve"
    street.bench.http.post(url, json={"outcome": outcome}).raise_for_status()
    street.post("back")
    with street.store.write() as session:
        session.get(RhythmRecord, "corner").learned_at -= timedelta(days=2)
    # Where nobody came, says the operator, these hours count.
    found = street.learns(time.time() + 60).rhythm.rates
    assert (min(found[14], found[38]) == pytest.approx(12)) == (outcome == "fixed")
    assert min(found[14], found[38]) <= rate


def test_hours_are_those_of_the_cameras_zone(street):
    street.settings = street.settings.model_copy(update={"timezone": "Asia/Tokyo"})
    street.people()
    rates = street.learns().rhythm.rates
    assert rates[(12 + 9) % 24] == pytest.approx(12)
    assert rates[12] == pytest.approx(0)
    assert street.silence(3.92).severity is None
    with pytest.raises(ValidationError, match="Europe/Berlin"):
        Settings(timezone="Mars/Olympus")


def test_it_is_learned_hourly_in_housekeeping_and_goes_with_its_camera(street):
    street.people()
    context = JobContext(settings=street.settings, store=street.store, queue=street.bench.queue)
    run_arrival_models(context)
    with street.store.read() as session:
        first = session.get(RhythmRecord, "corner")
        assert first.profile is not None
        assert load_arrivals(session, "corner", first.learned_at + timedelta(minutes=49)) is None
        late = first.learned_at + timedelta(minutes=51)
        assert load_arrivals(session, "corner", late) is not None
    run_arrival_models(context)
    with street.store.read() as session:
        assert session.get(RhythmRecord, "corner").learned_at == first.learned_at
    street.bench.http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    with street.store.read() as session:
        assert session.get(RhythmRecord, "corner") is None


def test_another_source_does_not_hide_that_the_counting_one_is_silent(street):
    street.people(until_s=MIDNIGHT_S - DAY_S)
    street.learns()
    with street.store.write() as session:
        references.newest(session, "corner").source = "unnamed"
    beside = {"source": "other", "tracks": [track("1", start_s=time.time() - 60)]}
    street.bench.http.post("/cameras/corner/tracks", json=beside).raise_for_status()
    assert street.watch(datetime.now(UTC)) == "no tracks come"
    beside["tracks"] = [track("2", start_s=time.time() - 30)]
    street.bench.http.post("/cameras/corner/tracks", json=beside).raise_for_status()
    assert street.watch(datetime.now(UTC)) is None
    assert street.bench.alerts()[0]["state"] == "firing"
