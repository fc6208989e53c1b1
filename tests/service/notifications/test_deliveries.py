"""What comes of attempts: retries, rests, giving up, and the order that is kept."""

import threading
import time
from datetime import UTC, datetime, timedelta
from ipaddress import ip_network

import pytest

from service.alerts.staleness import StaleWatch
from service.notifications.deliveries import load_attempt, save_attempt, save_refresh
from service.notifications.send import Outcome, post
from service.store import tracks
from service.store.cameras import CameraRecord
from service.workers import deliver
from service.workers.deliver import run_deliver
from service.workers.upkeep.reconciliation import run_reconcile
from service.workers.upkeep.retention import run_retention
from tests.conftest import track

LOOPBACK = (ip_network("127.0.0.0/8"),)


def until_next_s(delivery):
    last = datetime.fromisoformat(delivery["attempts"][-1]["started_at"])
    return (datetime.fromisoformat(delivery["next_attempt_at"]) - last).total_seconds()


def test_a_receiver_down_for_three_tries_gets_an_alert_once(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(500, 503, 502, 204)
    post_room.open()
    waits = []
    for _ in range(3):
        post_room.send_now(hook)
        (delivery,) = post_room.log(hook, state="pending")
        waits.append(until_next_s(delivery))
    post_room.send_now(hook)
    post_room.send_now(hook)
    assert len(inbox.received) == 4
    (message,) = inbox.deduped()
    assert message.verified(hook["secret"])["type"] == "alert.opened"
    (delivery,) = post_room.log(hook)
    assert [a["status_code"] for a in delivery["attempts"]] == [500, 503, 502, 204]
    assert "answered 500: 'no, not now'" in delivery["attempts"][0]["error"]
    for wait, scheduled in zip(waits, (5, 30, 120), strict=True):
        assert scheduled <= wait < 1.2 * scheduled + 10  # jitter, and the attempt itself
    shown = post_room.show(hook)
    assert (shown["failing_since"], shown["last_error"], shown["pending"]) == (None, None, 0)


def test_nothing_is_sent_before_its_time_and_the_reconcile_finds_it_then(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(500)
    post_room.open()
    post_room.send(hook)
    post_room.send(hook)
    assert len(inbox.received) == 1
    assert post_room.awaited() == []
    before = len(post_room.jobs())
    run_reconcile(post_room.context, StaleWatch())
    assert len(post_room.jobs()) == before
    with post_room.store.write() as session:
        session.connection().exec_driver_sql(
            "UPDATE deliveries SET next_attempt_at = '2026-01-01 00:00:00.000000'"
        )
    post_room.change(hook, held_until=None)
    assert post_room.awaited() == [hook["id"]]
    run_reconcile(post_room.context, StaleWatch())
    run_reconcile(post_room.context, StaleWatch())
    assert len(post_room.jobs()) == before + 1  # the first of them covers the second
    post_room.change(hook, job_queued_at=datetime.now(UTC) - timedelta(minutes=1))
    run_reconcile(post_room.context, StaleWatch())
    assert len(post_room.jobs()) == before + 1  # it waits, however long
    post_room.take(hook)
    post_room.change(hook, job_queued_at=datetime.now(UTC) - timedelta(minutes=1))
    run_reconcile(post_room.context, StaleWatch())
    assert len(post_room.jobs()) == before + 2  # a job that was lost is queued again


def test_messages_of_an_alert_keep_their_order_and_others_do_not_wait(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(422, 204)
    post_room.open("drift")
    post_room.end("drift")
    post_room.open("no_data")
    post_room.send(hook)
    told = [(m.json["type"], m.json["data"]["kind"]) for m in inbox.received]
    assert told == [("alert.opened", "drift"), ("alert.opened", "no_data")]
    post_room.send_now(hook)
    told = [(m.json["type"], m.json["data"]["kind"]) for m in inbox.received[2:]]
    assert told == [("alert.opened", "drift"), ("alert.resolved", "drift")]


def test_what_was_never_tried_is_due_though_it_was_made_by_a_clock_that_is_ahead(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open()
    with post_room.store.write() as session:
        session.connection().exec_driver_sql(
            "UPDATE deliveries SET next_attempt_at = '2099-01-01 00:00:00.000000'"
        )
    assert post_room.awaited() == [hook["id"]]
    post_room.send(hook)
    assert [m.json["type"] for m in inbox.received] == ["alert.opened"]


def test_an_endpoint_that_is_down_rests_and_is_told_all_when_it_is_back(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(503, 204)
    post_room.open("drift")
    post_room.open("no_data")
    post_room.send(hook)
    assert len(inbox.received) == 1  # the second is not thrown after the first
    assert post_room.show(hook)["held_until"] is not None
    post_room.change(hook, held_until=None)
    with post_room.store.write() as session:  # the first has hours to wait
        session.connection().exec_driver_sql(
            "UPDATE deliveries SET next_attempt_at = '2099-01-01 00:00:00.000000' WHERE tries = 1"
        )
    post_room.send(hook)
    assert [m.json["data"]["kind"] for m in inbox.received] == ["drift", "no_data", "drift"]
    assert post_room.log(hook, state="pending") == []


def test_a_delivery_that_fails_for_its_patience_is_given_up(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(400)
    post_room.open()
    post_room.end()
    with post_room.store.write() as session:
        session.connection().exec_driver_sql(
            "UPDATE deliveries SET queued_at = '2026-01-01 00:00:00.000000' "
            "WHERE type = 'alert.opened'"
        )
    post_room.send(hook)
    second, first = post_room.log(hook)
    assert (first["state"], first["next_attempt_at"]) == ("failed", None)
    assert first["finished_at"] is not None
    assert second["state"] == "pending"
    assert len(second["attempts"]) == 1  # it waits no longer for the one before it


def test_an_endpoint_that_fails_for_days_is_disabled_with_its_reason(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(500)
    post_room.open()
    post_room.change(hook, failing_since=datetime.now(UTC) - timedelta(hours=71))
    post_room.send_now(hook)
    assert post_room.show(hook)["enabled"] is True
    post_room.change(hook, failing_since=datetime.now(UTC) - timedelta(hours=73))
    post_room.send_now(hook)
    shown = post_room.show(hook)
    assert shown["enabled"] is False
    assert shown["disabled_reason"].startswith("it failed for more than 72 h: answered 500")
    assert shown["disabled_reason_code"] == "endpoint_fails"


def test_no_transaction_is_open_while_a_request_is_under_way(post_room, inbox):
    hook = post_room.hook(inbox.url)
    inbox.answer(204, wait_s=1.0)
    post_room.open("drift")
    sending = threading.Thread(target=post_room.send, args=(hook,))
    sending.start()
    while not inbox.received:
        pass
    post_room.open("no_data")  # would wait for the write lock until the answer is there
    assert post_room.log(hook)[1]["state"] == "pending"
    sending.join()
    assert [d["state"] for d in post_room.log(hook)] == ["delivered", "delivered"]


def test_a_worker_that_dies_before_its_record_sends_again_under_the_same_id(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open()
    context = post_room.context
    with post_room.store.read() as session:
        attempt = load_attempt(session, post_room.settings, hook["id"])
    message = attempt.message
    assert post(message.url, message.headers, message.body, LOOPBACK).ok
    run_deliver(context, hook["id"])
    assert len(inbox.received) == 2
    assert len(inbox.deduped()) == 1


def test_a_replay_during_an_attempt_is_not_covered_by_it(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open()
    with post_room.store.read() as session:
        attempt = load_attempt(session, post_room.settings, hook["id"])
    message = attempt.message
    outcome = post(message.url, message.headers, message.body, LOOPBACK)
    (delivery,) = post_room.log(hook)
    post_room.http.post(f"/deliveries/{delivery['id']}/replay").raise_for_status()
    with post_room.store.write() as session:
        save_attempt(session, post_room.settings, attempt, outcome)
    assert post_room.log(hook)[0]["state"] == "pending"
    post_room.send(hook)
    assert post_room.log(hook)[0]["state"] == "delivered"
    assert len(inbox.received) == 2


def test_a_webhook_that_is_removed_while_it_is_sent_to_leaves_nothing(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open()
    with post_room.store.read() as session:
        attempt = load_attempt(session, post_room.settings, hook["id"])
    message = attempt.message
    outcome = post(message.url, message.headers, message.body, LOOPBACK)
    post_room.http.delete(f"/webhooks/{hook['id']}").raise_for_status()
    with post_room.store.write() as session:
        save_attempt(session, post_room.settings, attempt, outcome)
        left = session.connection().exec_driver_sql(
            "SELECT (SELECT count(*) FROM deliveries) + (SELECT count(*) FROM delivery_attempts)"
        )
        assert left.scalar() == 0
    post_room.send(hook)


def test_what_ended_long_ago_is_forgotten_and_what_waits_in_vain_given_up(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open("drift")
    post_room.send(hook)
    post_room.open("no_data")
    post_room.open("clock")
    with post_room.store.write() as session:
        connection = session.connection()
        connection.exec_driver_sql(
            "UPDATE deliveries SET finished_at = '2026-01-01 00:00:00.000000' WHERE number = 1"
        )
        connection.exec_driver_sql(
            "UPDATE deliveries SET queued_at = '2026-01-01 00:00:00.000000' WHERE number = 2"
        )
    run_retention(post_room.context)
    kinds = [(d["payload"]["data"]["kind"], d["state"]) for d in post_room.log(hook)]
    assert kinds == [("clock", "pending"), ("no_data", "failed")]
    with post_room.store.read() as session:
        left = session.connection().exec_driver_sql("SELECT count(*) FROM delivery_attempts")
        assert left.scalar() == 0


def test_a_run_that_takes_too_long_leaves_the_rest_to_another(post_room, inbox, monkeypatch):
    hook = post_room.hook(inbox.url)
    post_room.open()
    monkeypatch.setattr(deliver, "_LONGEST_RUN_S", 0.0)
    post_room.send(hook)
    assert inbox.received == []
    assert post_room.jobs() == [hook["id"]] * 2
    monkeypatch.undo()
    post_room.send(hook)
    assert len(inbox.received) == 1
    assert post_room.jobs() == [hook["id"]] * 2  # nothing is left, no third one


def test_tracks_that_wait_still_are_told_of_once_though_another_worker_watches(post_room):
    settings = post_room.settings.model_copy(update={"stale_after_s": 0.05})
    batch = {"tracks": [track("1")]}
    post_room.http.post("/cameras/corner/tracks", json=batch).raise_for_status()

    def watch(by):
        with post_room.store.write() as session:
            return by.watch(session, settings)

    first = StaleWatch()
    watch(first)
    time.sleep(0.1)
    assert watch(first) == {"corner": "opened"}
    second = StaleWatch()
    assert watch(second) == {}
    (alert,) = post_room.http.get("/alerts").json()["items"]
    assert (alert["kind"], alert["state"]) == ("stale", "firing")
    with post_room.store.write() as session:  # now they are looked at
        session.get(CameraRecord, "corner").read_track_pk = tracks.newest_pk(session, "corner")
    assert watch(second) == {"corner": "ended"}


def test_an_endpoint_that_is_gone_by_then_has_another_url(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open()
    with post_room.store.read() as session:
        attempt = load_attempt(session, post_room.settings, hook["id"])
    other = {"url": inbox.url + "/other"}
    post_room.http.patch(f"/webhooks/{hook['id']}", json=other).raise_for_status()
    gone = Outcome(
        started_at=datetime.now(UTC), duration_s=1.0, status_code=410, error="answered 410"
    )
    with post_room.store.write() as session:
        save_attempt(session, post_room.settings, attempt, gone)
        save_refresh(session, post_room.settings, hook["id"], attempt.message, gone)
    shown = post_room.show(hook)
    assert (shown["enabled"], post_room.log(hook)[0]["state"]) == (True, "pending")
    post_room.send_now(hook)
    assert post_room.log(hook)[0]["state"] == "delivered"


@pytest.mark.parametrize("late", ["Fri, 31 Dec 2027 23:59:59 +9999999999999999", "9" * 400])
def test_a_time_to_come_back_that_is_none_is_no_end_of_it(post_room, inbox, late):
    hook = post_room.hook(inbox.url)
    inbox.answer((503, {"Retry-After": late}))
    post_room.open()
    post_room.send(hook)
    assert post_room.log(hook)[0]["state"] == "pending"
    assert len(post_room.log(hook)[0]["attempts"]) == 1
