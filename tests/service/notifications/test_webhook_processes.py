"""Deliveries by real processes over a real file and real sockets: what `kill -9` does not lose."""

import os
import signal

import pytest

from service.alerts import alerts
from service.reasons import as_said
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.running import RunningService, free_port, wait_for
from tests.service.notifications.receiver import receiver

pytestmark = pytest.mark.slow


@pytest.fixture
def service(settings):
    changes = {
        "port": free_port(),
        "trainings": "off",
        "webhook_allow": "127.0.0.1/32",
        "webhook_retry_s": "1",
        "alertmanager_refresh_s": 1,
    }
    running = RunningService(settings.model_copy(update=changes))
    running.start()
    wait_for(running.ready)
    running.http.post("/cameras", json=CAMERA).raise_for_status()
    yield running
    running.stop()


@pytest.fixture
def inbox():
    with receiver() as found:
        yield found


def open_alert(service, kind):
    """As the estimate job would, in a transaction of another process."""
    store = Store(service.settings)
    with store.write() as session:
        alerts.open_alert(
            session,
            service.settings,
            "corner",
            kind,
            "warning",
            {},
            None,
            reasons=as_said("a test"),
        )
    store.close()


def hook(service, url):
    answer = service.http.post("/webhooks", json={"url": url})
    answer.raise_for_status()
    return answer.json()


def log(service, made):
    return service.http.get(f"/webhooks/{made['id']}/deliveries").json()["items"]


def kill_all(service):
    os.kill(service.worker_pid(), signal.SIGKILL)
    service.kill()


def all_delivered(service, made, count):
    deliveries = log(service, made)
    return len(deliveries) == count and all(d["state"] == "delivered" for d in deliveries)


def test_a_receiver_down_for_three_tries_and_a_service_killed_between_lose_nothing(service, inbox):
    made = hook(service, inbox.url)
    inbox.answer(503, 503, 503, 204)
    open_alert(service, "drift")
    wait_for(lambda: inbox.received)
    kill_all(service)
    open_alert(service, "no_data")  # written, and nobody there to send it
    service.start()
    wait_for(lambda: all_delivered(service, made, 2))
    kinds = [message.verified(made["secret"])["data"]["kind"] for message in inbox.deduped()]
    assert sorted(kinds) == ["drift", "no_data"]
    answers = [a["status_code"] for d in log(service, made) for a in d["attempts"]]
    assert answers.count(204) == 2
    assert len(inbox.received) >= 5  # three that were refused, two that were taken


@pytest.mark.nightly
def test_a_worker_killed_while_it_sends_sends_again_under_the_same_id(service, inbox):
    made = hook(service, inbox.url)
    inbox.answer(204, wait_s=2.0)
    open_alert(service, "drift")
    wait_for(lambda: inbox.received, every_s=0.02)
    os.kill(service.worker_pid(), signal.SIGKILL)
    wait_for(lambda: all_delivered(service, made, 1))
    assert len(inbox.received) == 2
    (message,) = inbox.deduped()
    assert message.verified(made["secret"])["type"] == "alert.opened"
    (delivery,) = log(service, made)
    assert len(delivery["attempts"]) == 1  # the first was never written down


@pytest.mark.nightly
def test_a_slow_endpoint_holds_up_no_other(service, inbox):
    with receiver() as slow:
        slow.answer(204, wait_s=8.0)
        first, second = hook(service, slow.url), hook(service, inbox.url)
        open_alert(service, "drift")
        wait_for(lambda: slow.received and inbox.received)
        wait_for(lambda: all_delivered(service, second, 1))
        assert log(service, first)[0]["state"] == "pending"


@pytest.mark.nightly
def test_the_test_button_reaches_a_receiver(service, inbox):
    made = hook(service, inbox.url)
    service.http.post(f"/webhooks/{made['id']}/test").raise_for_status()
    wait_for(lambda: all_delivered(service, made, 1))
    assert inbox.received[0].verified(made["secret"])["type"] == "test"


@pytest.mark.nightly
def test_an_alertmanager_is_told_again_and_again_with_one_row_in_the_log(service, inbox):
    inbox.answer(200)
    body = {"url": inbox.url, "format": "alertmanager"}
    made = service.http.post("/webhooks", json=body).json()
    open_alert(service, "drift")
    wait_for(lambda: len(inbox.received) >= 4)
    assert all_delivered(service, made, 1)
    assert {m.json[0]["labels"]["alertname"] for m in inbox.received} == {"SurefootCameraDrift"}
