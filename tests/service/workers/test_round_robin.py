"""Turns that go round."""

from service.alerts.staleness import StaleWatch
from service.workers.context import RoundRobin
from service.workers.upkeep import reconciliation
from service.workers.upkeep.reconciliation import run_reconcile
from tests.conftest import CAMERA


def test_all_have_their_turns_though_some_come_and_go():
    turns = RoundRobin()
    assert turns.take(["a", "b", "c", "d", "e"], 2) == ["a", "b"]
    assert turns.take(["a", "b", "c", "d", "e"], 2) == ["c", "d"]
    assert turns.take(["a", "b", "c", "e"], 2) == ["e", "a"]  # d is gone
    assert turns.take(["a", "aa", "b", "c", "e"], 2) == ["aa", "b"]  # aa is new


def test_where_they_are_few_each_round_is_of_all_of_them_once():
    turns = RoundRobin()
    assert turns.take(["a", "b"], 5) == ["a", "b"]
    assert turns.take(["a", "b"], 5) == ["a", "b"]
    assert turns.take([], 5) == []


def test_of_many_cameras_ten_are_reconciled_a_second(post_room, monkeypatch):
    for n in range(11):
        post_room.http.post("/cameras", json={**CAMERA, "id": f"more-{n:02}"}).raise_for_status()
    seen = []

    def reconcile(session, queue, settings, camera_id, steps):
        seen.append(camera_id)
        return []

    monkeypatch.setattr(reconciliation, "reconcile_camera", reconcile)
    assert post_room.settings.reconcile_s == 1
    run_reconcile(post_room.context, StaleWatch())
    assert len(seen) == 10
    run_reconcile(post_room.context, StaleWatch())
    assert len(seen) == 20
    assert len(set(seen)) == 12
