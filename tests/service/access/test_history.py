"""The log has every act: each kind is done once, and kept with who, when and from where."""

import csv
import io
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from service.access import tokens
from service.access.activity import note, note_settings
from service.access.tokens import TokenSpec
from service.alerts.alerts import open_alert
from service.alerts.escalation import escalate
from service.app import create_app
from service.cameras.maintenance import note_ends
from service.enums import Activity, TrainingState
from service.reasons import as_said
from service.reports import escalated
from service.store import cameras
from service.store.cameras import ProposedPoseRecord
from service.store.engines.store import Store
from service.training import begin_training
from service.training.trainings import end_training
from tests.conftest import CAMERA, track
from tests.service.bench import Bench, moved
from tests.service.conftest import problem
from tests.service.life import still
from tests.service.street import known_street

# What the service does by itself, in nobody's name; all others are a person's.
BY_ITSELF = {
    Activity.REFERENCE_LEARNED,
    Activity.ALERT_OPENED,
    Activity.ALERT_GREW,
    Activity.ALERT_ESCALATED,
    Activity.ALERT_MAILED,
    Activity.MAINTENANCE_OVER,
    Activity.TRAINING_SUCCEEDED,
    Activity.TRAINING_FAILED,
    Activity.LOGIN_REFUSED,
    Activity.SETTINGS_CHANGED,
}
ANY = {"If-Match": "*"}


@pytest.fixture
def ada(settings):
    """The application with access on, asked by ada, who may do everything."""
    on = settings.model_copy(
        update={
            "auth": "on",
            "snapshots": "pictures",
            "window_tracks": 20,
            "escalate_after_min": 30.0,
            "smtp_host": "mail.example",
            "webhook_allow": "203.0.113.0/24",
        }
    )
    store = Store(on)
    with store.write() as session:
        made = tokens.make_token(session, TokenSpec(name="ada", scopes=("admin", "ingest")), None)
        token_id, secret = made.record.id, made.text
    store.close()
    with TestClient(create_app(on), headers={"Authorization": f"Bearer {secret}"}) as client:
        client.token_id, client.secret, client.settings = token_id, secret, on
        yield client


def ask(http, method, path, **more):
    answer = http.request(method, path, **more)
    assert answer.is_success, answer.text
    return answer.json() if answer.content else None


def hours(count):
    return (datetime.now(UTC) + timedelta(hours=count)).isoformat()


def look_after_alerts(http, bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=1.5))
    (alert,) = bench.alerts()
    url = f"/alerts/{alert['id']}"
    with bench.store.write() as session:
        session.execute(text("UPDATE alerts SET opened_at = '2026-01-01 00:00:00.000000'"))
    with bench.store.write() as session:
        escalate(session, http.settings)
        mail = escalated.next_mail(session, http.settings)
        escalated.note_mailed(session, mail, None)
    ask(http, "POST", f"{url}/acknowledge")
    ask(http, "POST", f"{url}/acknowledge", json={"acknowledged": False})
    ask(http, "POST", f"{url}/silence", json={"until": hours(1)})
    ask(http, "POST", f"{url}/silence", json={"until": None})
    bench.see(moved(tilt_deg=5.0))
    ask(http, "POST", f"{url}/resolve", json={"outcome": "false_alarm"})
    ask(http, "POST", "/cameras/corner/pose/undo")
    ask(http, "POST", "/cameras/corner/pose/put-back")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    ask(http, "POST", "/cameras/corner/pose/accept")
    with bench.store.write() as session:
        clock = open_alert(
            session, http.settings, "corner", "clock", "critical", {}, None, reasons=as_said("fast")
        )
        clock_id = clock.id
    ask(http, "POST", f"/alerts/{clock_id}/resolve", json={"outcome": "fixed"})
    ask(http, "POST", "/cameras/corner/reference/reset")


def look_after_cameras(http, bench):
    other = {"source": "other", "tracks": [track("1", start_s=bench.clock_s + 600)]}
    ask(http, "POST", "/cameras/corner/tracks", json=other)
    used = ask(http, "GET", "/cameras/corner/sources")["items"]
    (before,) = [each["name"] for each in used if each["name"] != "other"]
    ask(http, "POST", "/cameras/corner/sources/other/use")
    ask(http, "DELETE", f"/cameras/corner/sources/{before}")
    path = "/cameras/corner/maintenance"
    window = ask(http, "POST", path, json={"from": hours(2), "to": hours(3)})
    ask(http, "PATCH", f"{path}/{window['id']}", json={"to": hours(4)})
    ask(http, "DELETE", f"{path}/{window['id']}")
    window = ask(http, "POST", path, json={"to": hours(1)})
    ask(http, "DELETE", f"{path}/{window['id']}")
    ask(http, "POST", path, json={"to": hours(1)})
    with bench.store.write() as session:
        assert note_ends(session, "corner", datetime.now(UTC) + timedelta(hours=2))
    headers = {"Content-Type": "image/jpeg"}
    ask(http, "PUT", "/cameras/corner/snapshot", content=still(), headers=headers)
    ask(http, "DELETE", "/cameras/corner/snapshot")
    ask(http, "PUT", "/cameras/corner/plan?metres_per_pixel=0.1", content=still(), headers=headers)
    ask(http, "DELETE", "/cameras/corner/plan")
    door = {"id": "door", "on": "ground", "points": [[300, 400], [500, 410], [480, 600]]}
    ask(http, "PUT", "/cameras/corner/zones", json={"zones": [door]}, headers=ANY)
    for change in ({"name": "The other corner"}, {"walking_speed": {"mean_mps": 1.3}}):
        ask(http, "PATCH", "/cameras/corner", json=change, headers=ANY)
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    ask(http, "POST", "/cameras", json=bare | {"id": "gate"})
    with bench.store.write() as session:
        session.add(
            ProposedPoseRecord(
                prior_pose_id=cameras.prior_pose(session, "gate").id,
                **{"height_m": 5.8, "tilt_rad": 0.4, "roll_rad": 0.0},
                covariance=[[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-3]],
                identifiable=["tilt", "roll", "height"],
                **{"tracks": 80, "walking_groups": 61},
                created_at=datetime.now(UTC),
            )
        )
    ask(http, "POST", "/cameras/gate/pose/confirm")
    ask(http, "DELETE", "/cameras/gate", headers=ANY)


def train(http, bench):
    asked = ask(http, "POST", "/cameras/corner/trainings")
    ask(http, "DELETE", f"/trainings/{asked['id']}")
    asked = ask(http, "POST", "/cameras/corner/trainings")
    with bench.store.write() as session:
        attempt = begin_training(session, http.settings, asked["id"])
        end_training(session, attempt, TrainingState.FAILED, "no room on the disk")


def look_after_others(http):
    hook = ask(http, "POST", "/webhooks", json={"url": "https://203.0.113.7/"})["id"]
    ask(http, "PATCH", f"/webhooks/{hook}", json={"name": "pager"})
    ask(http, "POST", f"/webhooks/{hook}/secret")
    delivery = ask(http, "POST", f"/webhooks/{hook}/test")["id"]
    ask(http, "POST", f"/deliveries/{delivery}/replay")
    ask(http, "DELETE", f"/webhooks/{hook}")
    made = ask(http, "POST", "/tokens", json={"name": "=SUM(1)", "scopes": ["read"]})
    ask(http, "DELETE", f"/tokens/{made['id']}")
    given = ask(http, "POST", "/handovers", json={"since": hours(-8), "note": "all calm"})
    ask(http, "POST", f"/handovers/{given['id']}/take")
    http.post("/ui/login", data={"token": http.secret}, follow_redirects=False)
    bearer = http.headers.pop("Authorization")
    http.post("/ui/logout", follow_redirects=False)
    assert http.get("/cameras", headers={"Authorization": "Bearer sf_0_0"}).status_code == 401
    http.headers["Authorization"] = bearer


def csv_of(http, **query):
    answer = http.get("/activity", params={"format": "csv", **query})
    assert answer.headers["content-type"].startswith("text/csv")
    return list(csv.DictReader(io.StringIO(answer.text)))


@pytest.mark.slow
def test_every_kind_of_act_is_kept_with_who_when_and_from_where(ada):
    known_street(ada, ada.settings, 60).close()
    bench = Bench(ada, ada.settings)
    look_after_alerts(ada, bench)
    look_after_cameras(ada, bench)
    train(ada, bench)
    look_after_others(ada)
    with bench.store.write() as session:
        note_settings(session, ada.settings)
    lines = csv_of(ada)
    assert {line["what"] for line in lines} == set(Activity)
    for line in lines[1:]:  # the first made ada's own token, by nobody
        by = ("", "", "") if line["what"] in BY_ITSELF else ("ada", ada.token_id, "testclient")
        if line["what"] == Activity.LOGIN_REFUSED:
            by = ("", "", "testclient")
        assert (line["by"], line["via"], line["address"]) == by, line
        assert datetime.fromisoformat(line["at"]).tzinfo is not None
    items = ada.get("/activity", params={"limit": 1000}).json()["items"]
    assert [str(item["id"]) for item in items] == [line["id"] for line in lines]
    (named,) = [line for line in lines if line["subject_id"] and "=SUM" in line["details"]][-1:]
    assert named["details"].startswith("{")  # no cell is a formula
    bench.store.close()
    bench.queue.close()


def test_settings_are_kept_where_they_are_others_than_before_and_no_secret(http, settings):
    store = Store(settings)
    started = [
        settings.model_copy(update={"drift_people": 20, "mqtt_password": "a pass word"}),
        settings.model_copy(update={"drift_people": 20, "mqtt_password": "another"}),
        settings.model_copy(update={"drift_people": 30}),
        settings.model_copy(),
    ]
    for each in started:
        with store.write() as session:
            note_settings(session, each)
    entries = http.get("/activity").json()["items"]
    own = {name: entries[-1]["details"].get(name) for name in entries[-1]["details"]}
    assert [entry["details"] for entry in entries] == [
        {**own, "drift_people": "20", "mqtt_password": "set"},
        {**own, "drift_people": "30"},
        own,
    ]
    assert "pass word" not in str(entries)


def test_an_address_in_the_settings_is_kept_without_password_and_path(http, settings):
    url = "https://ada:a-pass-word@surefoot.example/x"
    with Store(settings).write() as session:
        note_settings(session, settings.model_copy(update={"public_url": url}))
    (entry,) = http.get("/activity").json()["items"]
    assert entry["details"]["public_url"] == "https://surefoot.example"
    assert "a-pass-word" not in str(entry)


def test_days_are_chosen_and_a_file_goes_on_from_a_cursor(http, settings):
    with Store(settings).write() as session:
        for n in range(1203):
            note(session, Activity.TOKEN_ADDED, by=f"=n{n}")
    lines = csv_of(http)
    assert [line["by"] for line in lines] == [f"'=n{n}" for n in range(1203)]
    assert [line["id"] for line in csv_of(http, after=lines[5]["id"], limit=2)] == [
        lines[6]["id"],
        lines[7]["id"],
    ]
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    assert csv_of(http, **{"from": later}) == []
    assert len(csv_of(http, to=later)) == 1203
    found = http.get("/activity", params={"from": lines[7]["at"], "to": lines[9]["at"]}).json()
    assert [item["by"] for item in found["items"]] == ["=n7", "=n8"]
    problem(http.get("/activity", params={"from": "yesterday"}), 422, "malformed")
