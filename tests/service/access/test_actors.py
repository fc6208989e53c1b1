"""Who acted is the person that was let in, whatever name a body says."""

from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient

from service.access import tokens
from service.access.tokens import TokenSpec
from service.app import create_app
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.bench import Bench, moved
from tests.service.cameras.test_plans import SCALE
from tests.service.cameras.test_snapshots import JPEG, image


@pytest.fixture
def closed(settings):
    """The application with access on, asked by ada, who may do everything."""
    on = settings.model_copy(update={"auth": "on", "snapshots": "pictures"})
    store = Store(on)
    with store.write() as session:
        made = tokens.make_token(session, TokenSpec(name="ada", scopes=("admin", "ingest")), None)
        token_id, text = made.record.id, made.text
    store.close()
    with TestClient(create_app(on), headers={"Authorization": f"Bearer {text}"}) as client:
        client.token_id = token_id
        assert client.post("/cameras", json=CAMERA).status_code == 201
        yield client


def entries(client, what):
    items = client.get("/activity", params={"limit": 1000}).json()["items"]
    return [item for item in items if item["what"] == what]


def test_every_act_is_kept_with_the_person_and_the_token(closed):
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    mallory = {"by": "mallory"}
    camera = closed.get("/cameras/corner")
    etag = {"If-Match": camera.headers["ETag"]}
    window = closed.post("/cameras/corner/maintenance", json={"to": later, **mallory})
    hook = closed.post("/webhooks", json={"url": "https://8.8.8.8/", "name": "pager"}).json()["id"]
    acts = [
        ("POST", "/cameras/corner/reference/reset", {"json": mallory}),
        ("POST", "/cameras/corner/trainings", {"json": mallory}),
        ("DELETE", f"/cameras/corner/maintenance/{window.json()['id']}", {}),
        ("PUT", "/cameras/corner/plan", {"content": image(), "headers": JPEG, "params": SCALE}),
        ("DELETE", "/cameras/corner/plan", {}),
        ("PATCH", "/cameras/corner", {"json": {"name": "New"}, "headers": etag}),
        ("PATCH", f"/webhooks/{hook}", {"json": {"name": "other"}}),
        ("POST", f"/webhooks/{hook}/secret", {}),
        ("DELETE", f"/webhooks/{hook}", {}),
        ("POST", "/tokens", {"json": {"name": "gate", "scopes": ["ingest"]}}),
    ]
    for method, path, more in acts:
        assert closed.request(method, path, **more).is_success, path
    etag = {"If-Match": closed.get("/cameras/corner").headers["ETag"]}
    assert closed.delete("/cameras/corner", headers=etag).status_code == 204
    for what in (
        "camera.registered",
        "camera.described",
        "camera.removed",
        "reference.reset",
        "training.requested",
        "maintenance.planned",
        "maintenance.ended",
        "plan.kept",
        "plan.removed",
        "webhook.added",
        "webhook.changed",
        "webhook.secret_changed",
        "webhook.removed",
        "token.added",
    ):
        found = entries(closed, what)
        assert found, what
        assert (found[-1]["by"], found[-1]["via"]) == ("ada", closed.token_id), what
    assert "mallory" not in closed.get("/activity", params={"limit": 1000}).text


def test_an_alert_says_who_was_logged_in(closed, settings):
    bench = Bench(closed, settings.model_copy(update={"window_tracks": 20}))
    for _ in range(3):
        bench.see(moved(tilt_deg=1.5))
    (alert,) = closed.get("/alerts").json()["items"]
    alert_id = alert["id"]
    answer = closed.post(f"/alerts/{alert_id}/acknowledge", json={"by": "mallory"})
    assert answer.json()["acknowledged_by"] == "ada"
    until = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    answer = closed.post(f"/alerts/{alert_id}/silence", json={"until": until, "by": "mallory"})
    assert answer.json()["silenced_by"] == "ada"
    body = {"outcome": "false_alarm", "by": "mallory"}
    answer = closed.post(f"/alerts/{alert_id}/resolve", json=body)
    assert answer.json()["resolved_by"] == "ada"
    assert {act["by"] for act in answer.json()["acts"]} == {"ada"}


def test_with_access_off_the_name_that_is_said_is_kept(corner):
    corner.post("/cameras/corner/reference/reset", json={"by": "grace"})
    (entry,) = entries(corner, "reference.reset")
    assert (entry["by"], entry["via"]) == ("grace", None)


def test_a_login_is_kept_and_never_its_secret(closed):
    text = closed.headers["Authorization"].split()[1]
    closed.post("/ui/login", data={"token": text}, follow_redirects=False)
    (entry,) = entries(closed, "session.began")
    assert (entry["by"], entry["via"]) == ("ada", closed.token_id)
    assert text.split("_", 2)[2] not in closed.get("/activity", params={"limit": 1000}).text
