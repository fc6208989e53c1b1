"""The flow map grows with a still camera's tracks, stops at a doubt, and forgets what was none.

The window that it is to judge stays out of it.
"""

import time
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from sqlalchemy import delete, select

from models.paths.reference import paths_from_bytes
from models.pose import learn_site
from models.tracks.trajectory import by_end
from service.estimation import growth
from service.estimation.anchoring import LearnedPaths
from service.estimation.compute import compute_estimate
from service.estimation.estimates import save_estimate
from service.estimation.evidence import load_evidence
from service.estimation.growth import compute_growth, load_growth, save_growth
from service.store import alerts, references
from service.store.estimates import EstimateRecord
from service.store.references import FlowMapRecord
from service.store.tracks import TrackRecord
from tests.conftest import CAMERA
from tests.service.estimation.answered import put_back
from tests.service.street import KNOCKED, PRIOR, Street

WANTED = 60
UNSURE = 20
WINDOW = 60
DAY_S = 86_400.0


def make_street(http, settings, ago_s=20_000.0):
    changes = {"window_tracks": WINDOW, "flow_unsure_tracks": UNSURE, "flow_half_life_days": 10.0}
    street = Street(http, settings.model_copy(update=changes))
    street.clock_s = time.time() - ago_s
    return street


def learn_street(http, settings, ago_s):
    http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
    street = make_street(http, settings, ago_s)
    street.keep_to_lanes(PRIOR, WANTED)
    assert street.look()["reference"]["state"] == "ready"
    return street


@pytest.fixture
def settings(settings):
    """People of the next minutes are taken, so that they come after what a person said now."""
    return settings.model_copy(update={"max_ahead_s": 3600.0})


@pytest.fixture(params=[20_000.0])
def known(request, learned):
    """A street whose reference is learned, and its map with it, so many seconds ago."""

    return learned(f"growth-{request.param:.0f}", partial(learn_street, ago_s=request.param))


def map_of(street):
    with street.context.store.read() as session:
        return session.get(FlowMapRecord, references.newest(session, "corner").id)


def ended(street, first, last):
    return [float(seen.time_s[-1]) for seen in street.seen[first:last]]


def due(street):
    with street.context.store.read() as session:
        return load_growth(session, street.context.settings, "corner")


def test_a_map_is_learned_with_its_reference(known):
    first = map_of(known)
    assert (first.tracks, first.weight) == (WANTED, WANTED)
    assert first.to_s == pytest.approx(ended(known, 0, WANTED)[-1])
    assert paths_from_bytes(first.data).density.log_density.shape[3] == 16


@pytest.mark.nightly
def test_it_grows_by_a_quarter_of_itself_and_by_50_at_the_least(known):
    first = map_of(known)
    known.keep_to_lanes(PRIOR, 49 + WINDOW)
    known.look()
    assert map_of(known).learned_at == first.learned_at
    known.keep_to_lanes(PRIOR, 1)
    known.look()
    grown = map_of(known)
    assert grown.tracks == WANTED + 50  # the newest 60 are what it is to judge
    assert grown.to_s == pytest.approx(ended(known, 0, WANTED + 50)[-1])
    assert grown.data != first.data
    assert paths_from_bytes(grown.data).bandwidths.tracks == WANTED  # kept: the same hours
    known.look()
    assert map_of(known).learned_at == grown.learned_at
    known.keep_to_lanes(PRIOR, 20)
    body = known.look()
    assert map_of(known).learned_at == grown.learned_at
    assert body["estimates"]["registered"]["tracks"] == WINDOW  # by the grown map


@pytest.mark.nightly
@pytest.mark.parametrize("known", [20 * DAY_S], indirect=True)
def test_older_tracks_count_less_and_no_more_than_so_many_at_all(known):
    known.clock_s += 10 * DAY_S
    known.keep_to_lanes(PRIOR, 60 + WINDOW)
    known.look()
    grown = map_of(known)
    ends = np.array(ended(known, 0, WANTED + 60))
    ages_days = (ends[-1] - ends) / DAY_S
    assert grown.weight == pytest.approx((0.5 ** (ages_days / 10.0)).sum())
    assert grown.weight == pytest.approx(WANTED / 2 + 60, rel=0.01)
    few = known.context.settings.model_copy(update={"flow_tracks": 50})
    with known.context.store.write() as session:
        record = session.get(FlowMapRecord, grown.reference_id)
        session.delete(record)
    with known.context.store.read() as session:
        period = load_growth(session, few, "corner")
    assert len(period.trajectories) == 50
    assert period.to_s == grown.to_s


def test_a_worker_that_dies_before_it_has_grown_leaves_it_to_the_next(known):
    known.keep_to_lanes(PRIOR, 70 + WINDOW)
    context = known.context
    with context.store.read() as session:
        evidence = load_evidence(session, context.settings, "corner")
    finding = compute_estimate(evidence, 0)
    with context.store.write() as session:
        save_estimate(session, context.queue, context.settings, evidence, finding)
    period = due(known)
    learned = compute_growth(period, 0)  # and here it dies, or is thought to be dead
    again = make_street(known.http, context.settings)
    again.look()
    grown = map_of(again)
    assert (grown.tracks, grown.data, grown.chart) == (WANTED + 70, learned.flow, learned.chart)
    late = LearnedPaths(flow=b"late", chart=b"late")
    with context.store.write() as session:
        assert not save_growth(session, "corner", period, late)
    assert map_of(known).data == learned.flow
    assert due(known) is None


def test_it_stops_once_the_camera_may_have_moved(known):
    first = map_of(known)
    known.keep_to_lanes(PRIOR, 45)
    known.look()
    known.keep_to_lanes(KNOCKED, 60)
    body = known.look()
    assert (body["state"], len(known.alerts())) == ("drifting", 1)  # the chart waits for no other
    assert "drift chart" in body["reason"]
    known.keep_to_lanes(KNOCKED, 60)
    known.look()
    assert map_of(known).learned_at == first.learned_at


def knocked_and_put_back(known, outcome):
    """60 still, 60 knocked, the alert resolved, 120 still again."""
    known.keep_to_lanes(PRIOR, 60)
    known.look()
    for _ in range(2):
        known.keep_to_lanes(KNOCKED, 30)
        known.look()
    (alert,) = known.alerts(state="firing")
    answer = {"outcome": outcome, "by": "Ada"}
    known.http.post(f"/alerts/{alert['id']}/resolve", json=answer).raise_for_status()
    known.clock_s = time.time() + 60
    for _ in range(2):
        known.keep_to_lanes(PRIOR, 60)
        known.look()


@pytest.mark.nightly
def test_what_was_seen_until_it_was_put_back_never_counts(known):
    knocked_and_put_back(known, "put_back")
    assert known.pose()["state"] == "ok"
    grown = map_of(known)
    assert grown.to_s == pytest.approx(ended(known, 0, 300 - WINDOW)[-1])
    # Where exactly it moved is known give or take a few tracks.
    assert grown.tracks == pytest.approx(WANTED + 60 + 120 - WINDOW, abs=4)
    assert grown.tracks <= WANTED + 60 + 120 - WINDOW
    with known.context.store.write() as session:
        (alert,) = alerts.ended(session, "corner")
        alert.outcome = "false_alarm"
        session.delete(session.get(FlowMapRecord, grown.reference_id))
    assert len(due(known).trajectories) == WANTED + 60 + 60 + 120 - WINDOW


@pytest.mark.nightly
def test_a_reset_answers_what_was_doubted_before(known):
    for _ in range(2):
        known.keep_to_lanes(KNOCKED, 30)
        known.look()
    assert len(known.alerts(state="firing")) == 1
    known.http.post("/cameras/corner/reference/reset").raise_for_status()
    known.clock_s += 100
    known.keep_to_lanes(PRIOR, WANTED)  # all of them walked hours before the reset
    known.look()
    assert map_of(known).tracks == WANTED
    known.keep_to_lanes(PRIOR, 50 + WINDOW)
    known.look()
    assert map_of(known).tracks == WANTED + 50


def test_a_false_alarm_lets_it_grow_on(known):
    known.keep_to_lanes(PRIOR, 60)
    known.look()
    with known.context.store.write() as session:
        alert = put_back(ended(known, WANTED, WANTED + 1)[0])
        alert.state, alert.resolved_at, alert.outcome = "firing", None, None
        session.add(alert)
    known.keep_to_lanes(PRIOR, 40)
    assert due(known) is None
    answer = {"outcome": "false_alarm"}
    known.http.post(f"/alerts/{'a' * 32}/resolve", json=answer).raise_for_status()
    assert due(known) is None  # whoever comes from now on has to show that it stands still
    known.keep_to_lanes(PRIOR, 40)
    known.look()
    assert map_of(known).tracks == WANTED + 100


def test_a_change_that_nobody_has_explained_stops_it(known):
    first = map_of(known)
    with known.context.store.write() as session:
        reference = references.newest(session, "corner")
        reference.changed_s = reference.to_s + 1
    known.keep_to_lanes(PRIOR, 60 + WINDOW)
    assert known.look()["state"] == "ok"
    assert map_of(known).learned_at == first.learned_at


def test_paths_that_have_changed_stop_it(known):
    first = map_of(known)
    known.keep_to_lanes(PRIOR, 60)
    known.look()
    known.keep_to_lanes(PRIOR, 50)
    with known.context.store.write() as session:
        last = session.scalars(select(EstimateRecord).order_by(EstimateRecord.id.desc())).first()
        last.raw = {"joint": last.raw["joint"]}  # as an estimate that left the map out
    assert due(known) is None
    known.look()
    assert map_of(known).learned_at > first.learned_at


def test_a_map_outlives_the_tracks_that_it_was_learned_of(known):
    first = map_of(known)
    with known.context.store.write() as session:
        session.execute(delete(TrackRecord))  # as retention does in a month
    known.keep_to_lanes(PRIOR, WANTED - 5 + WINDOW)
    body = known.look()
    assert map_of(known).learned_at == first.learned_at  # 55 tracks are less than it knows
    assert "registered" in body["estimates"]
    known.keep_to_lanes(PRIOR, 10)
    known.look()
    assert map_of(known).tracks == WANTED + 5


def test_a_reference_of_before_there_were_maps_gets_one(known):
    with known.context.store.write() as session:
        session.execute(delete(FlowMapRecord))
    known.keep_to_lanes(PRIOR, 10)
    assert "registered" not in known.look()["estimates"]
    assert map_of(known).tracks == WANTED
    known.keep_to_lanes(PRIOR, 10)
    assert "registered" in known.look()["estimates"]


def test_people_who_stand_make_no_map_and_are_not_asked_again(known):
    with known.context.store.write() as session:
        record = session.get(FlowMapRecord, references.newest(session, "corner").id)
        record.data = None
    known.keep_to_lanes(PRIOR, 40)
    body = known.look()
    assert due(known) is None  # too few that are new
    assert "heading_deg" not in body["estimated"]
    known.keep_to_lanes(PRIOR, 10 + WINDOW)
    known.look()
    assert map_of(known).data is not None


def test_a_map_goes_with_its_reference_and_its_camera(known):
    known.http.post("/cameras/corner/reference/reset").raise_for_status()
    assert map_of(known) is None
    known.http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    with known.context.store.read() as session:
        assert session.scalars(select(FlowMapRecord)).all() == []


def test_a_map_with_tracks_of_a_move_in_it_is_learned_without_them(known):
    known.keep_to_lanes(PRIOR, 70 + WINDOW)
    known.look()
    assert map_of(known).tracks == WANTED + 70
    moved_s = ended(known, 0, WANTED + 30)[-1]
    with known.context.store.write() as session:
        session.add(put_back(moved_s))
    known.keep_to_lanes(PRIOR, 1)
    known.look(full=True)
    again = map_of(known)
    assert again.tracks == WANTED + 29
    assert again.to_s < moved_s
    known.keep_to_lanes(PRIOR, 1)
    known.look(full=True)
    assert map_of(known).learned_at == again.learned_at


def test_map_grows_from_a_crowd_that_loses_ends_to_slow_drift(known, monkeypatch):
    """What a camera that had not crept would not have shown is cut off: another order of ends."""
    known.keep_to_lanes(PRIOR, 49 + WINDOW)
    known.look()
    known.keep_to_lanes(PRIOR, 1)
    period = due(known)
    begin_s = period.trajectories[0].time_s[0]
    crowd = by_end(
        replace(track, time_s=track.time_s - track.time_s[0] + begin_s + n)
        for n, track in enumerate(period.trajectories)
    )
    cut = [_first(track, len(track.time_s) - 2 * (n % 3)) for n, track in enumerate(crowd)]
    assert [track.time_s[-1] for track in cut] != sorted(track.time_s[-1] for track in cut)
    taken = {}

    def learn(observations, *args, weights, **how):
        taken["weights"] = weights
        return learn_site(observations, *args, weights=weights, **how)

    monkeypatch.setattr(growth, "slow_drift_log_from_bytes", lambda _: None)
    monkeypatch.setattr(growth, "without_slow_drift", lambda *_: [None, *cut[1:]])
    monkeypatch.setattr(growth, "learn_site", learn)
    anchor = SimpleNamespace(record=SimpleNamespace(creep=b""), from_s=None)
    weights = np.linspace(0.5, 1.0, len(cut))
    busy = replace(period, anchor=anchor, trajectories=tuple(crowd), weights=weights)
    assert compute_growth(busy, seed=0) is not None
    order = sorted(range(1, len(cut)), key=lambda n: cut[n].time_s[-1])
    assert taken["weights"].tolist() == weights[order].tolist()


def _first(track, points):
    return replace(track, time_s=track.time_s[:points], uv=track.uv[:points])
