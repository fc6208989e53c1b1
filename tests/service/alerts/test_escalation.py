"""Alerts that nobody took up are told of once more; those that somebody did are not."""

from datetime import UTC, datetime, timedelta

import pytest

from service.alerts.escalation import escalate
from service.alerts.staleness import StaleWatch
from service.store.alerts import AlertRecord
from service.workers.context import JobContext
from service.workers.upkeep.reconciliation import run_reconcile
from tests.service.fleet_bench import Fleet


@pytest.fixture
def duty(post_room, inbox):
    """A post room that escalates after half an hour, and its webhook."""
    post_room.settings = post_room.settings.model_copy(update={"escalate_after_min": 30.0})
    old = post_room.context
    post_room.context = JobContext(settings=post_room.settings, store=old.store, queue=old.queue)
    post_room.made = post_room.hook(inbox.url)
    return post_room


def age(post_room, alert_id, minutes):
    with post_room.store.write() as session:
        record = session.get(AlertRecord, alert_id)
        record.opened_at = datetime.now(UTC) - timedelta(minutes=minutes)


def reconcile(post_room):
    run_reconcile(post_room.context, StaleWatch())
    post_room.send_now(post_room.made)


def show(post_room, alert_id):
    return post_room.http.get(f"/alerts/{alert_id}").json()


def test_it_is_told_once_and_said_on_the_pages(duty, inbox):
    alert_id = duty.open()
    reconcile(duty)
    age(duty, alert_id, 31)
    for _ in range(3):
        reconcile(duty)
    assert inbox.types() == ["alert.opened", "alert.escalated"]
    told = inbox.received[-1].verified(duty.made["secret"])["data"]
    assert (told["id"], told["escalated_at"]) == (alert_id, show(duty, alert_id)["escalated_at"])
    (act,) = show(duty, alert_id)["acts"]
    assert (act["action"], act["by"]) == ("escalated", None)
    assert "escalated: nobody took it up in 31 minutes" in duty.http.get("/ui/alerts").text
    duty.http.post(f"/alerts/{alert_id}/acknowledge", json={"by": "Ada"}).raise_for_status()
    page = duty.http.get("/ui/alerts").text
    assert "acknowledged by Ada" in page
    assert "nobody took it up" not in page


def test_what_was_given_back_waits_as_long_again(duty, inbox):
    alert_id = duty.open()
    duty.http.post(f"/alerts/{alert_id}/acknowledge").raise_for_status()
    age(duty, alert_id, 31)
    body = {"acknowledged": False}
    duty.http.post(f"/alerts/{alert_id}/acknowledge", json=body).raise_for_status()
    reconcile(duty)
    assert "alert.escalated" not in inbox.types()
    at_once = duty.settings.model_copy(update={"escalate_after_min": 0.0})
    with duty.store.write() as session:
        escalate(session, at_once)
    assert show(duty, alert_id)["escalated_at"] is not None


def test_what_somebody_took_up_is_not(duty, inbox):
    seen, quiet = duty.open(), duty.open(kind="no_data")
    duty.http.post(f"/alerts/{seen}/acknowledge", json={"by": "Ada"}).raise_for_status()
    until = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    duty.http.post(f"/alerts/{quiet}/silence", json={"until": until}).raise_for_status()
    for alert_id in (seen, quiet):
        age(duty, alert_id, 600)
    reconcile(duty)
    assert "alert.escalated" not in inbox.types()
    # The end of a silence is told, and half an hour begins with it.
    duty.http.post(f"/alerts/{quiet}/silence", json={"until": None}).raise_for_status()
    reconcile(duty)
    assert inbox.types()[-1] == "alert.updated"
    assert show(duty, quiet)["escalated_at"] is None


def test_a_group_speaks_for_its_members(duty):
    fleet = Fleet(duty.settings)
    with fleet.store.write() as session:
        for n, group in enumerate((None, "g" * 32)):
            session.add(
                AlertRecord(
                    id="gm"[n] * 32, camera_id="corner" if group else None, group_id=group,
                    track_source="bytetrack", kind="clock" if group else "many_moved",
                    state="firing", source="group", severity="critical", reasons=(),
                    drift={}, camera_ids=None if group else [],
                    opened_at=fleet.now - timedelta(hours=1), updated_at=fleet.now,
                )
            )  # fmt: skip
            session.flush()
    fleet.close()
    run_reconcile(duty.context, StaleWatch())
    assert show(duty, "g" * 32)["escalated_at"] is not None
    assert show(duty, "m" * 32)["escalated_at"] is None


def test_unset_nothing_is_told_again(post_room, inbox):
    hook = post_room.hook(inbox.url)
    age(post_room, post_room.open(), 6000)
    run_reconcile(post_room.context, StaleWatch())
    post_room.send_now(hook)
    assert inbox.types() == ["alert.opened"]
