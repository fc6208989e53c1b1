import os
import sqlite3

from service.job_queue import JobQueue
from service.store.engines.store import Store
from service.workers.processes.workers import register_worker
from tests.conftest import CAMERA
from tests.service.conftest import problem
from tests.stores.databases import ask, only_sqlite


def test_health_is_the_process(http):
    assert http.get("/healthz").json() == {"status": "ok"}


def test_ready_needs_a_worker(http, settings):
    body = http.get("/readyz")
    assert body.status_code == 503
    assert "worker: none was ever heard of" in body.json()["problems"][0]
    with Store(settings).write() as session:
        register_worker(session, "w", os.getpid())
    body = http.get("/readyz")
    assert body.status_code == 200
    assert body.json()["status"] == "ready"


@only_sqlite("takes the file away")
def test_ready_needs_a_store(http, settings):
    for path in settings.data_dir.glob("surefoot.sqlite*"):
        path.unlink()
    sqlite3.connect(settings.database_path).close()
    body = http.get("/readyz").json()
    assert body["store_writable"] is False
    assert body["problems"][0].startswith("store:")


def test_the_description_names_every_path(http):
    paths = http.get("/openapi.json").json()["paths"]
    assert {
        "/cameras", "/cameras/{camera_id}", "/cameras/{camera_id}/tracks",
        "/cameras/{camera_id}/pose", "/cameras/{camera_id}/pose/history",
        "/cameras/{camera_id}/pose/accept", "/cameras/{camera_id}/trainings",
        "/trainings/{training_id}", "/alerts", "/alerts/{alert_id}",
        "/alerts/{alert_id}/acknowledge", "/alerts/{alert_id}/resolve", "/events", "/healthz",
        "/readyz", "/metrics", "/webhooks", "/webhooks/{webhook_id}",
        "/webhooks/{webhook_id}/secret", "/webhooks/{webhook_id}/test",
        "/webhooks/{webhook_id}/deliveries", "/deliveries/{delivery_id}",
        "/deliveries/{delivery_id}/replay",
    } <= set(paths)  # fmt: skip
    assert http.get("/docs").status_code == 200


def test_what_is_not_there_is_a_problem_document(http):
    problem(http.get("/nowhere"), 404, "not_found")
    problem(http.put("/cameras"), 405, "method_not_allowed")
    problem(http.get("/trainings/none"), 404, "not_found")
    problem(http.get("/alerts", params={"state": "loud"}), 422, "malformed")


def test_an_enqueued_job_lives_and_dies_with_its_transaction(settings):
    store = Store(settings)
    queue = JobQueue(store.engine)
    with store.write() as session:
        queue.enqueue_training(session, "corner", "a" * 32)
        session.rollback()
    with store.write() as session:
        queue.enqueue_training(session, "corner", "b" * 32)
    rows = ask(settings, "SELECT workflow_uuid FROM workflow_status")
    assert rows == [("train-" + "b" * 32,)]


def test_a_refused_registration_queues_nothing(http, settings):
    http.post("/cameras", json=CAMERA)
    http.post("/cameras", json=CAMERA)
    assert ask(settings, "SELECT count(*) FROM workflow_status") == [(1,)]
