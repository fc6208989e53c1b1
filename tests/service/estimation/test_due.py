"""Between full estimates of a stationary camera, new tracks update the monitor alone."""

from datetime import UTC, datetime, timedelta
from unittest.mock import Mock

import numpy as np
import pytest
from sqlalchemy import select

from models.assessment import chart_basis, context_from_bytes, score_part, scored_from_bytes
from service.estimation.compute import site_of
from service.estimation.evidence import load_evidence
from service.store import estimates
from service.store.cameras import CameraRecord
from service.store.monitor_states import MonitorStateRecord
from service.store.references import FlowMapRecord
from service.store.stamps import follow_clock
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


def monitor_state(street):
    with street.context.store.read() as session:
        return session.get(MonitorStateRecord, "corner")


def test_monitor_run_reads_and_scores_new_tracks_alone(stationary, monkeypatch):
    whole = monitor_state(stationary)
    known = scored_from_bytes(whole.scored)
    assert known.key.size == 120
    assert whole.newer == b""

    refuse = Mock(side_effect=AssertionError("the whole window was read"))
    monkeypatch.setattr("service.workers.estimate.load_evidence", refuse)
    for new in (1, 5):
        before = stationary.pose()
        stationary.keep_to_lanes(PRIOR, new)
        body = stationary.look()
        assert body["checked_at"] > before["checked_at"]
        assert body["updated_at"] == before["updated_at"]
    state = monitor_state(stationary)
    assert state.scored == whole.scored
    newer = scored_from_bytes(state.newer)
    window = known.merged(newer)
    assert window.key.size == 126
    assert newer.key.size <= 6 + 2 * 20  # new ones, and twice a tail
    with stationary.context.store.read() as session:
        evidence = load_evidence(session, stationary.context.settings, "corner")
    site = site_of(evidence, [])
    trajectories = [track.trajectory for track in evidence.tracks]
    keys = np.array([track.pk for track in evidence.tracks])
    context = context_from_bytes(state.context)
    at_once = score_part(keys, trajectories, chart_basis(site), context)
    np.testing.assert_array_equal(window.key, at_once.key)
    np.testing.assert_allclose(window.values, at_once.values, rtol=1e-12, atol=1e-12)


def test_full_estimate_replaces_the_monitor_state(stationary):
    stationary.keep_to_lanes(PRIOR, 5)
    stationary.look()
    assert monitor_state(stationary).newer
    stationary.keep_to_lanes(PRIOR, 1)
    stationary.look(full=True)
    state = monitor_state(stationary)
    assert state.newer == b""
    assert scored_from_bytes(state.scored).key.size == 126


def test_run_after_the_map_changed_scores_the_whole_window(stationary):
    before = monitor_state(stationary)
    with stationary.context.store.write() as session:
        flow = session.scalars(select(FlowMapRecord)).one()
        flow.learned_at += timedelta(seconds=1)
    stationary.keep_to_lanes(PRIOR, 1)
    stationary.look()
    state = monitor_state(stationary)
    assert state.basis != before.basis
    assert scored_from_bytes(state.scored).key.size == 121


def test_setback_of_the_clock_deletes_monitor_states(stationary):
    with stationary.context.store.write() as session:
        follow_clock(session, timedelta(seconds=5), datetime.now(UTC), 3600.0)
    assert monitor_state(stationary) is None


def test_run_without_new_tracks_keeps_checked_at(stationary, monkeypatch):
    before = stationary.pose()
    refuse = Mock(side_effect=AssertionError("the whole window was read"))
    monkeypatch.setattr("service.workers.estimate.load_evidence", refuse)
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
