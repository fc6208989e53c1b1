"""Stored addresses: callers without `admin` see no more than scheme, host and port."""

import pytest

from service.access.activity import note_settings
from service.access.tokens import Caller, address_for
from service.addresses import origin_of
from service.api.middleware.scopes import NEEDS
from service.notifications.webhooks import WebhookSpec, create_webhook
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.access.test_access import closed, made, on  # noqa: F401

SECRET = "s3cr3t"
URL = f"http://camera.example:81/{SECRET}/now.jpg?user=viewer&password={SECRET}"


@pytest.mark.parametrize(
    ("url", "origin"),
    [
        (URL, "http://camera.example:81"),
        (f"HTTPS://viewer:{SECRET}@Camera.example/", "https://camera.example"),
        (f"http://[fd00::1]:80?{SECRET}", "http://[fd00::1]:80"),
        (f"http://camera.example#{SECRET}", "http://camera.example"),
        (f"mqtts://ada:{SECRET}@broker.example:8883/{SECRET}", "mqtts://broker.example:8883"),
    ],
)
def test_origin_of_address_has_no_secret(url, origin):
    assert origin_of(url) == origin


def test_address_is_whole_for_admin_alone():
    def seen_by(*scopes):
        return address_for(Caller(name="ada", scopes=frozenset(scopes)), URL)

    assert seen_by("read") == seen_by("operate") == seen_by("ingest") == "http://camera.example:81"
    assert seen_by("admin") == address_for(None, URL) == URL
    assert address_for(None, None) is None


def test_no_answer_to_read_or_operate_has_the_secret_of_an_address(closed, made, on):  # noqa: F811
    """`GET /cameras` showed both the whole address, with its password."""
    admin = made("admin")
    body = {**CAMERA, "snapshot_url": URL}
    answer = closed.post("/cameras", json=body, headers=admin)
    assert answer.json()["snapshot_url"] == URL
    with Store(on).write() as session:
        hook = f"https://hooks.example.com/{SECRET}"
        spec = WebhookSpec(url=hook, name="", kinds=None, format="webhook", enabled=True)
        hook_id = create_webhook(session, on, spec).record.id
        addresses = {"public_url": f"https://surefoot.example/{SECRET}"}
        note_settings(session, on.model_copy(update=addresses))
        session.get_one(CameraRecord, "corner").snapshot_error = "answered 500"
    shown = closed.get("/cameras/corner", headers=admin).json()
    assert shown["snapshot_url"] == URL
    assert SECRET in closed.get(f"/webhooks/{hook_id}", headers=admin).text
    asked = 0
    for scope in ("read", "operate"):
        headers = made(scope, name=scope)
        for method, path in NEEDS:
            if method != "GET" or path == "/events":
                continue
            one = path.replace("{camera_id}", "corner").replace("{webhook_id}", hook_id)
            answer = closed.get(one, headers=headers)
            asked += answer.status_code == 200
            assert SECRET not in answer.text, (scope, path)
        shown = closed.get("/cameras", headers=headers).json()["items"][0]
        assert shown["snapshot_url"] == "http://camera.example:81"
    assert asked > 50
