"""Webhooks: their secrets, what is written for them and when, the log, test and replay."""

from datetime import UTC, datetime, timedelta

import pytest
from standardwebhooks import Webhook, WebhookVerificationError

from service.alerts import alerts
from service.api.alerts import AlertDetail
from service.enums import MessageType
from service.notifications.outbox import alert_body
from service.reasons import as_said
from service.store.alerts import AlertRecord
from tests.service.conftest import problem
from tests.service.notifications.receiver import receiver


@pytest.fixture
def inbox():
    with receiver() as found:
        yield found


def test_a_webhook_is_made_shown_changed_and_removed(post_room, inbox):
    http = post_room.http
    answer = http.post("/webhooks", json={"url": inbox.url, "name": "pager"})
    made = answer.json()
    assert answer.headers["location"] == f"/webhooks/{made['id']}"
    assert made["secret"].startswith("whsec_")
    shown = http.get(answer.headers["location"]).json()
    assert shown == {key: value for key, value in made.items() if key != "secret"}
    assert (shown["kinds"], shown["enabled"], shown["pending"]) == (None, True, 0)
    assert http.get("/webhooks").json() == {"items": [shown]}
    assert "whsec_" not in http.get("/webhooks").text
    patch = {"name": "other", "kinds": ["drift"], "enabled": False}
    changed = http.patch(f"/webhooks/{made['id']}", json=patch).json()
    assert {name: changed[name] for name in patch} == patch
    assert changed["disabled_reason"] == "disabled by a person"
    again = http.patch(f"/webhooks/{made['id']}", json={"kinds": None, "enabled": True}).json()
    assert (again["kinds"], again["disabled_reason"]) == (None, None)
    assert (changed["disabled_reason_code"], again["disabled_reason_code"]) == (
        "disabled_by_person", None
    )  # fmt: skip
    assert http.delete(f"/webhooks/{made['id']}").status_code == 204
    problem(http.get(f"/webhooks/{made['id']}"), 404, "not_found")


@pytest.mark.parametrize(
    ("method", "path"),
    [("GET", "/webhooks/no"), ("PATCH", "/webhooks/no"), ("DELETE", "/webhooks/no"),
     ("POST", "/webhooks/no/secret"), ("POST", "/webhooks/no/test"),
     ("GET", "/webhooks/no/deliveries"), ("GET", "/deliveries/no"),
     ("POST", "/deliveries/no/replay")],
)  # fmt: skip
def test_what_is_not_there_is_a_problem(http, method, path):
    body = {"json": {}} if method == "PATCH" else {}
    problem(http.request(method, path, **body), 404, "not_found")


def test_malformed_bodies_name_their_fields(http):
    for body, pointer in [
        ({}, "/url"),
        ({"url": "http://a.invalid", "kinds": ["loud"]}, "/kinds/0"),
        ({"url": "http://a.invalid", "kinds": []}, "/kinds"),
        ({"url": "http://a.invalid", "colour": "red", "format": "smoke"}, "/format"),
    ]:
        found = problem(http.post("/webhooks", json=body), 422, "malformed")
        assert found["errors"][0]["pointer"] == pointer


def test_an_alert_and_its_message_are_one_transaction(post_room, inbox):
    hook = post_room.hook(inbox.url)
    with post_room.store.write() as session:
        alerts.open_alert(
            session,
            post_room.settings,
            "corner",
            "drift",
            "warning",
            {},
            None,
            reasons=as_said("r"),
        )
        session.flush()
        session.rollback()
    assert (post_room.log(hook), post_room.jobs()) == ([], [])
    post_room.open()
    (delivery,) = post_room.log(hook)
    assert (delivery["state"], delivery["type"]) == ("pending", "alert.opened")
    assert post_room.jobs() == [hook["id"]]
    assert post_room.show(hook)["pending"] == 1


def test_a_message_is_the_alert_as_it_was_signed_under_a_stable_id(post_room, inbox):
    hook = post_room.hook(inbox.url)
    alert_id = post_room.open()
    then = post_room.http.get(f"/alerts/{alert_id}").json()
    post_room.http.post(f"/alerts/{alert_id}/acknowledge", json={"by": "ada"}).raise_for_status()
    post_room.open(severity="critical")
    post_room.end()
    post_room.send(hook)
    assert inbox.types() == [
        "alert.opened", "alert.acknowledged", "alert.updated", "alert.resolved"
    ]  # fmt: skip
    first = inbox.received[0]
    assert first.verified(hook["secret"])["data"] | {"acts": []} == then
    with pytest.raises(WebhookVerificationError):
        Webhook(hook["secret"]).verify(first.body + " ", first.headers)
    assert len(set(inbox.ids())) == 4
    log = post_room.log(hook)
    assert [delivery["id"] for delivery in log] == inbox.ids()[::-1]
    assert {delivery["state"] for delivery in log} == {"delivered"}
    assert log[0]["attempts"][0]["status_code"] == 204
    assert log[0]["attempts"][0]["duration_s"] > 0
    assert inbox.received[3].json["data"]["outcome"] == "cleared"
    assert post_room.show(hook)["delivered_at"] is not None


def test_a_message_has_what_an_alert_has():
    body = alert_body(AlertRecord(reasons=(), drift={}))
    assert set(body) == set(AlertDetail.model_fields) - {"acts"}


def test_only_kinds_that_are_wanted_and_enabled_webhooks_are_told(post_room, inbox):
    drift = post_room.hook(inbox.url, kinds=["drift"])
    every = post_room.hook(inbox.url)
    off = post_room.hook(inbox.url, enabled=False)
    post_room.open("no_data")
    post_room.open("drift")
    assert [d["payload"]["data"]["kind"] for d in post_room.log(drift)] == ["drift"]
    assert [d["payload"]["data"]["kind"] for d in post_room.log(every)] == ["drift", "no_data"]
    assert post_room.log(off) == []
    assert post_room.show(off)["disabled_reason"] == "disabled by a person"


def test_a_silenced_alert_is_quiet_until_it_ends(post_room, inbox):
    hook = post_room.hook(inbox.url)
    alert_id = post_room.open()
    with post_room.store.write() as session:
        record = alerts.show_alert(session, alert_id)
        record.silenced_until = datetime.now(UTC) + timedelta(hours=1)
        alerts._tell(session, record, MessageType.ALERT_SILENCED)
    post_room.open(severity="critical")
    post_room.http.post(f"/alerts/{alert_id}/acknowledge").raise_for_status()
    post_room.end()
    post_room.send(hook)
    assert inbox.types() == ["alert.opened", "alert.silenced", "alert.resolved"]


def test_a_silence_that_is_over_is_none(post_room, inbox):
    hook = post_room.hook(inbox.url)
    alert_id = post_room.open()
    with post_room.store.write() as session:
        alerts.show_alert(session, alert_id).silenced_until = datetime.now(UTC)
    post_room.open(severity="critical")
    assert [d["type"] for d in post_room.log(hook)] == ["alert.updated", "alert.opened"]


def test_a_removed_camera_ends_its_alerts_and_says_so(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open("drift")
    post_room.open("no_data")
    etag = post_room.http.get("/cameras/corner").headers["etag"]
    post_room.http.delete("/cameras/corner", headers={"If-Match": etag}).raise_for_status()
    post_room.send(hook)
    ends = [m.json for m in inbox.received if m.json["type"] == "alert.resolved"]
    assert {end["data"]["kind"] for end in ends} == {"drift", "no_data"}
    assert {end["data"]["outcome"] for end in ends} == {"camera_removed"}


def test_rotation_signs_with_both_secrets_for_a_day(post_room, inbox):
    hook = post_room.hook(inbox.url)
    rotated = post_room.http.post(f"/webhooks/{hook['id']}/secret").json()
    assert rotated["secret"] != hook["secret"]
    until = datetime.fromisoformat(rotated["old_secret_until"])
    assert timedelta(hours=23) < until - datetime.now(UTC) <= timedelta(hours=24)
    assert post_room.show(hook)["old_secret_until"] == rotated["old_secret_until"]
    post_room.open()
    post_room.send(hook)
    (both,) = inbox.received
    assert both.verified(rotated["secret"]) == both.verified(hook["secret"])
    assert len(both.headers["webhook-signature"].split(" ")) == 2
    post_room.change(hook, old_secret_until=datetime.now(UTC))
    post_room.end()
    post_room.send(hook)
    later = inbox.received[1]
    assert later.verified(rotated["secret"])["type"] == "alert.resolved"
    with pytest.raises(WebhookVerificationError):
        later.verified(hook["secret"])


def test_the_test_button(post_room, inbox):
    hook = post_room.hook(inbox.url, name="pager")
    answer = post_room.http.post(f"/webhooks/{hook['id']}/test")
    assert answer.status_code == 202
    assert post_room.jobs() == [hook["id"]]
    post_room.send(hook)
    body = inbox.received[0].verified(hook["secret"])
    assert (body["type"], body["data"]["name"]) == ("test", "pager")
    shown = post_room.http.get(f"/deliveries/{answer.json()['id']}").json()
    assert (shown["state"], shown["alert_id"]) == ("delivered", None)
    post_room.http.patch(f"/webhooks/{hook['id']}", json={"enabled": False}).raise_for_status()
    off = problem(post_room.http.post(f"/webhooks/{hook['id']}/test"), 409, "conflict")
    assert "disabled by a person" in off["detail"]


def test_a_replay_is_the_same_message_again(post_room, inbox):
    hook = post_room.hook(inbox.url)
    post_room.open()
    post_room.send(hook)
    (delivery,) = post_room.log(hook, state="delivered")
    replayed = post_room.http.post(f"/deliveries/{delivery['id']}/replay")
    assert (replayed.status_code, replayed.json()["state"]) == (202, "pending")
    assert len(post_room.jobs()) == 2
    post_room.send(hook)
    first, second = inbox.received
    assert first.headers["webhook-id"] == second.headers["webhook-id"]
    assert first.body == second.body
    assert len(inbox.deduped()) == 1
    assert len(post_room.log(hook)[0]["attempts"]) == 2
    post_room.change(hook, enabled=False)
    problem(post_room.http.post(f"/deliveries/{delivery['id']}/replay"), 409, "conflict")


def test_the_log_is_cut_and_filtered(post_room, inbox):
    hook = post_room.hook(inbox.url)
    for _ in range(3):
        post_room.http.post(f"/webhooks/{hook['id']}/test").raise_for_status()
    assert len(post_room.log(hook, limit=2)) == 2
    assert len(post_room.log(hook, state="pending")) == 3
    assert post_room.log(hook, state="failed") == []
    path = f"/webhooks/{hook['id']}/deliveries"
    problem(post_room.http.get(path, params={"state": "lost"}), 422, "malformed")
    assert len(post_room.jobs()) == 1  # one job covers them all
