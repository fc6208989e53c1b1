"""The anchor: each day is scored once against the first map, which detects slow drift."""

import math
import time
from dataclasses import replace

import pytest
from sqlalchemy import select

from models.durations import DAY_S
from models.monitoring.slow_drift import slow_drift_log_from_bytes
from service.estimation.anchoring import (
    compute_anchor_days,
    load_anchor_days,
    save_anchor_days,
)
from service.estimation.growth import load_growth
from service.store import references
from service.store.references import AnchorRecord, FlowMapRecord
from tests.conftest import CAMERA
from tests.service.street import PRIOR, Street

WANTED, A_DAY, WINDOW = 100, 30, 60


@pytest.fixture
def settings(settings):
    """People of weeks ago are no silence, and those of the next minutes are taken."""
    return settings.model_copy(update={"max_ahead_s": 3600.0, "no_data_after_h": 1e5})


@pytest.fixture
def known(learned):
    """A street whose reference was learned at the beginning of a day, 80 days ago."""

    def make(http, settings):
        http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
        changes = {"window_tracks": WINDOW, "flow_unsure_tracks": 20}
        street = Street(http, settings.model_copy(update=changes))
        street.clock_s = (time.time() // DAY_S - 80) * DAY_S
        street.keep_to_lanes(PRIOR, WANTED)
        assert street.look()["reference"]["state"] == "ready"
        return street

    return learned("anchor", make)


def live(street, days, *, pan_deg_a_day=0.0, begin_deg=0.0, look_every=5):
    """So many days of people, the camera turning, and a look now and then."""
    for day in range(1, days + 1):
        street.clock_s = (street.clock_s // DAY_S + 1) * DAY_S + 8 * 3600
        turn = math.radians(begin_deg + pan_deg_a_day * day)
        street.keep_to_lanes(replace(PRIOR, heading_rad=PRIOR.heading_rad + turn), A_DAY)
        if day % look_every == 0:
            street.look()


def anchor(street):
    with street.context.store.read() as session:
        return session.get(AnchorRecord, references.newest(session, "corner").id)


def flow_map(street):
    with street.context.store.read() as session:
        return session.get(FlowMapRecord, references.newest(session, "corner").id)


def due(street):
    with street.context.store.read() as session:
        return load_growth(session, street.context.settings, "corner")


def days_of(street):
    record = anchor(street)
    return [] if record.creep is None else list(slow_drift_log_from_bytes(record.creep).day_idx)


@pytest.mark.nightly
def test_the_first_map_stays_as_the_map_grows(known):
    first = anchor(known)
    assert (first.flow, first.chart) == (flow_map(known).data, flow_map(known).chart)
    assert (first.creep, first.logged_to_s) == (None, None)
    live(known, 5)
    grown, kept = flow_map(known), anchor(known)
    assert grown.data != first.flow
    assert grown.to_s > first.to_s
    assert (kept.flow, kept.chart, kept.to_s) == (first.flow, first.chart, first.to_s)


@pytest.mark.nightly
@pytest.mark.filterwarnings("default::RuntimeWarning")  # as in a worker
def test_an_alert_of_the_day_after_an_afternoons_reference_can_be_opened_and_read(http, settings):
    """Its log lay before any ramp: PostgreSQL refused the evidence, SQLite could not read it."""
    http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
    street = Street(http, settings)
    street.clock_s = (time.time() // DAY_S - 3) * DAY_S + 18 * 3600
    street.keep_to_lanes(PRIOR, WANTED)
    assert street.look()["reference"]["state"] == "ready"
    street.keep_to_lanes(PRIOR, 80)
    street.clock_s = (street.clock_s // DAY_S + 1) * DAY_S + 8 * 3600
    street.keep_to_lanes(PRIOR, 5)
    street.look()
    assert len(days_of(street)) == 1
    street.keep_to_lanes(replace(PRIOR, tilt_rad=PRIOR.tilt_rad + math.radians(5)), 60)
    street.look()
    (alert,) = street.alerts(state="firing")
    evidence = http.get(f"/alerts/{alert['id']}/evidence").raise_for_status().json()
    assert evidence["creep"] is None
    assert evidence["chart"]["statistic"] > evidence["chart"]["level"]
    street.close()


def test_whole_days_are_logged_once(known):
    day = int(known.clock_s // DAY_S)
    live(known, 3, look_every=3)
    assert days_of(known) == [day + 1, day + 2]  # the third is not over yet
    assert anchor(known).logged_to_s == (day + 3) * DAY_S
    before = anchor(known).creep
    known.look()
    assert anchor(known).creep == before
    live(known, 1, look_every=1)
    assert days_of(known) == [day + 1, day + 2, day + 3]


def test_of_a_busy_day_some_are_logged_evenly(known):
    known.clock_s = (known.clock_s // DAY_S + 1) * DAY_S
    known.keep_to_lanes(PRIOR, 250)
    live(known, 1, look_every=2)
    settings = known.context.settings
    with known.context.store.read() as session:
        days = load_anchor_days(session, settings, "corner")
    ends = {float(track.time_s[-1]) for track in days.trajectories}
    every = [float(track.time_s[-1]) for track in known.seen[WANTED : WANTED + 250]]
    places = [place for place, end in enumerate(every) if round(end, 6) in
              {round(end, 6) for end in ends}]  # fmt: skip
    assert len(places) == 100
    assert max(later - sooner for sooner, later in zip(places, places[1:], strict=False)) == 3


def test_a_job_that_is_late_keeps_nothing(known):
    live(known, 2, look_every=3)
    settings = known.context.settings
    with known.context.store.read() as session:
        days = load_anchor_days(session, settings, "corner")
    log = compute_anchor_days(days)
    known.look()
    with known.context.store.write() as session:
        save_anchor_days(session, days, b"late")
    assert anchor(known).creep == log
    assert anchor(known).creep != b"late"


def test_a_new_reference_makes_a_new_anchor(known):
    first = anchor(known)
    known.http.post("/cameras/corner/reference/reset").raise_for_status()
    assert anchor(known) is None
    known.clock_s = time.time() + 60
    known.keep_to_lanes(PRIOR, WANTED + 5)  # some follow so closely that they may be one
    known.look()
    second = anchor(known)
    assert second.reference_id != first.reference_id
    assert second.flow == flow_map(known).data
    known.http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    with known.context.store.read() as session:
        assert session.scalars(select(AnchorRecord)).all() == []


def test_an_anchor_that_cannot_be_read_is_said_and_stops_nothing(known):
    with known.context.store.write() as session:
        record = session.get(AnchorRecord, references.newest(session, "corner").id)
        record.flow = b"of another release"
    live(known, 2, look_every=2)
    body = known.pose()
    assert body["state"] == "ok"
    assert "without the anchor: cannot be read" in body["reason"]


def test_the_newest_may_be_of_a_move_though_the_window_is_shorter(known):
    live(known, 1, look_every=2)
    known.keep_to_lanes(PRIOR, 50 + 20 - 1 - A_DAY)
    settings = known.context.settings.model_copy(update={"window_tracks": 12})
    known.context = replace(known.context, settings=settings)
    known.look()
    assert due(known) is None
    known.keep_to_lanes(PRIOR, 1)
    assert len(due(known).trajectories) == WANTED + 50


@pytest.mark.nightly
@pytest.mark.timeout(900)
def test_slow_drift_is_reported_and_the_pose_is_measured_by_the_first_map(known):
    live(known, 10)
    assert known.pose()["state"] == "ok"
    assert known.alerts() == []
    turned = 0.0
    while not known.alerts(state="firing") and turned < 3.0:
        live(known, 5, pan_deg_a_day=0.1, begin_deg=turned)
        turned += 0.5
    (alert,) = known.alerts(state="firing")
    assert alert["kind"] == "drift"
    assert alert["reason_code"] == "slow_drift"
    assert "has drifted slowly by +" in alert["reason"]
    assert alert["reason_values"]["number"] == "heading"
    assert turned < 2.5
    body = known.look()
    assert body["state"] == "drifting"
    off, sd = body["drift"]["heading_deg"] - turned, body["sd"]["heading_deg"]
    assert abs(off) < 3 * sd
    assert abs(off) < 1.0
    # The operator accepts the position: slow drift is measured from this pose on.
    known.http.post("/cameras/corner/pose/accept", json={"by": "Ada"}).raise_for_status()
    assert anchor(known) is None
    assert known.alerts(state="firing") == []


def test_a_false_alarm_has_the_log_begin_anew(known):
    live(known, 4, pan_deg_a_day=0.0, begin_deg=4.0, look_every=2)
    (alert,) = known.alerts(state="firing")
    logged = days_of(known)
    answer = {"outcome": "false_alarm", "by": "Ada"}
    known.http.post(f"/alerts/{alert['id']}/resolve", json=answer).raise_for_status()
    assert days_of(known) == logged  # what was seen stays; it counts no more
    with known.context.store.read() as session:
        reference = references.newest(session, "corner")
        assert reference.window_from_s > known.clock_s - DAY_S
