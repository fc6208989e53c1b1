"""A clock that was set back keeps nothing waiting that waits for a time."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy.exc import OperationalError

from service.alerts.arrival_models import HourCounts, load_arrivals, save_arrival_model
from service.estimate_queue import is_cooling
from service.store import references, webhooks
from service.store.engines.store import Store
from service.store.workers import WorkerRecord
from service.workers.processes.workers import register_worker
from service.workers.upkeep.periodic import ClockWatch, follow_clock_since_last_run
from tests.running import free_port
from tests.service.bench import PRIOR


@pytest.mark.parametrize(
    ("ahead_s", "waits"), [(None, False), (-5, False), (0, False), (5, True), (3600, False)]
)
def test_a_time_further_ahead_than_any_is_of_before_the_clock_was_set(ahead_s, waits):
    now = datetime.now(UTC)
    at = None if ahead_s is None else now + timedelta(seconds=ahead_s)
    assert is_cooling(at, now) is waits


def test_what_waits_to_be_delivered_follows_the_clock(post_room):
    hook = post_room.hook(f"http://127.0.0.1:{free_port()}/")  # nobody listens
    post_room.open()
    post_room.send(hook)
    clock = ClockWatch()
    an_hour_later(post_room)
    clock.look(post_room.context)
    assert next_in_s(post_room) > 3600
    clock._ahead_s += 3600
    clock.look(post_room.context)
    assert 0 < next_in_s(post_room) < 60
    clock.look(post_room.context)
    assert 0 < next_in_s(post_room) < 60


def test_a_clock_that_was_set_back_while_nothing_could_be_written_is_seen_later(post_room):
    hook = post_room.hook(f"http://127.0.0.1:{free_port()}/")
    post_room.open()
    post_room.send(hook)
    clock = ClockWatch()
    an_hour_later(post_room)
    clock._ahead_s += 3600
    with post_room.store.write(), pytest.raises(OperationalError):
        clock.look(replace(post_room.context, store=Store(post_room.settings, patience_s=0.05)))
    assert next_in_s(post_room) > 3600
    clock.look(post_room.context)
    assert 0 < next_in_s(post_room) < 60


def test_a_clock_that_was_set_back_while_no_worker_watched_is_seen_by_the_next(post_room):
    """The delivery waits by the clock of before; the worker that kept it was killed meanwhile."""
    hook = post_room.hook(f"http://127.0.0.1:{free_port()}/")
    post_room.open()
    post_room.send(hook)
    with post_room.store.write() as session:
        register_worker(session, "local-0", 1)
        hour = timedelta(hours=1)
        session.get(WorkerRecord, "local-0").heartbeat_at += hour
        for record in webhooks.waiting(session, datetime.now(UTC)):
            record.next_attempt_at += hour
        for record in webhooks.every(session):
            record.held_until += hour
    assert next_in_s(post_room) > 3600
    follow_clock_since_last_run(post_room.context)
    assert 0 < next_in_s(post_room) < 60
    follow_clock_since_last_run(post_room.context)
    assert 0 < next_in_s(post_room) < 60


def an_hour_later(post_room):
    """An hour passes, to be taken back."""
    with post_room.store.write() as session:
        for record in (*webhooks.waiting(session, datetime.now(UTC)), *webhooks.every(session)):
            for name in ("next_attempt_at", "held_until"):
                if hasattr(record, name):
                    setattr(record, name, getattr(record, name) + timedelta(hours=1))


def next_in_s(post_room):
    now = datetime.now(UTC)
    with post_room.store.read() as session:
        (delivery,) = webhooks.waiting(session, now)
        (webhook,) = webhooks.every(session)
    return max((at - now).total_seconds() for at in (delivery.next_attempt_at, webhook.held_until))


def test_arrivals_are_learned_whatever_the_clock_said(corner, settings):
    now = datetime.now(UTC)
    with Store(settings).write() as session:
        save_arrival_model(
            session, "corner", None, HourCounts(tracks={}, latest_s={}), now + timedelta(days=30)
        )
        assert load_arrivals(session, "corner", now) is not None


def test_who_comes_after_an_answer_of_the_future_is_judged(bench):
    bench.see(PRIOR)
    bench.http.post("/cameras/corner/pose/put-back").raise_for_status()
    with bench.store.write() as session:
        references.newest(session, "corner").answered_at += timedelta(days=30)
    for _ in range(2):
        bench.see(PRIOR)
    assert bench.pose()["state"] == "ok"
