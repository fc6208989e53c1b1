"""`GET /metrics`: what it says, and that Prometheus' own tools read it."""

import os
import shutil
import subprocess
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient
from prometheus_client.openmetrics.parser import text_string_to_metric_families as open_families
from prometheus_client.parser import text_string_to_metric_families as families

from service.alerts import alerts
from service.app import create_app
from service.workers.processes.workers import register_worker
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem

PROMTOOL = os.environ.get("SUREFOOT_TEST_PROMTOOL") or shutil.which("promtool")
needs_promtool = pytest.mark.skipif(
    PROMTOOL is None, reason="no promtool: apt-get install prometheus, or SUREFOOT_TEST_PROMTOOL"
)


def scrape(http):
    """Values by name and labels."""
    answer = http.get("/metrics")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/plain; version=")
    return {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in families(answer.text)
        for sample in family.samples
    }


def value(found, name, **labels):
    return found[(name, *sorted(labels.items()))]


def test_an_empty_service_says_that_it_is_empty(http):
    found = scrape(http)
    for state in ("unconnected", "learning", "ok", "drifting", "no_data"):
        assert value(found, "surefoot_cameras", state=state) == 0
    assert value(found, "surefoot_alerts_firing", kind="drift", severity="critical") == 0
    assert value(found, "surefoot_queue_lag_seconds") == 0
    assert value(found, "surefoot_build_info", version="0.1.0") == 1


def test_a_knocked_camera_in_figures(bench):
    for _ in range(4):
        bench.see(PRIOR)
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0, height_m=0.5), unidentifiable=("roll",))
    found = scrape(bench.http)
    assert bench.pose()["state"] == "drifting"
    assert value(found, "surefoot_cameras", state="drifting") == 1
    assert value(found, "surefoot_cameras", state="ok") == 0
    assert value(found, "surefoot_camera_state", camera_id="corner", state="drifting") == 1
    assert value(found, "surefoot_camera_state", camera_id="corner", state="ok") == 0
    drift = value(found, "surefoot_camera_drift_radians", camera_id="corner", number="tilt")
    assert drift == pytest.approx(0.0873, abs=0.001)  # 5 deg
    height = value(found, "surefoot_camera_drift_height_meters", camera_id="corner")
    assert height == pytest.approx(0.5, abs=0.01)
    name = "surefoot_camera_drift_radians"
    assert (name, ("camera_id", "corner"), ("number", "roll")) not in found  # it is not told
    newest = value(found, "surefoot_camera_last_track_timestamp_seconds", camera_id="corner")
    assert newest == pytest.approx(bench.clock_s + 19 + 0.4 * 19)
    assert value(found, "surefoot_alerts_firing", kind="drift", severity="critical") == 1
    assert value(found, "surefoot_alert_firing", camera_id="corner", kind="drift") == 1
    assert value(found, "surefoot_trainings", state="succeeded") == 1
    assert value(found, "surefoot_queue_lag_seconds") > 0  # nothing has run the jobs
    assert value(found, "surefoot_events_total") >= 3


@pytest.mark.parametrize("looks", [0, 1, 4])
def test_the_state_is_the_one_that_is_served(bench, looks):
    for _ in range(looks):
        bench.see(moved(tilt_deg=5.0))
    found = scrape(bench.http)
    state = bench.pose()["state"]
    assert value(found, "surefoot_camera_state", camera_id="corner", state=state) == 1
    assert sum(v for key, v in found.items() if key[0] == "surefoot_camera_state") == 1


def test_a_new_reference_takes_the_drift_away(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    found = scrape(bench.http)
    assert value(found, "surefoot_camera_state", camera_id="corner", state="learning") == 1
    assert not [key for key in found if key[0] == "surefoot_camera_drift_radians"]


def test_alerts_workers_and_deliveries_in_figures(post_room):
    hook = post_room.hook("http://127.0.0.1:9/", name='the "pager"\\')
    first = post_room.open("drift")
    post_room.open("no_data")
    with post_room.store.write() as session:
        until = datetime.now(UTC) + timedelta(hours=1)
        alerts.show_alert(session, first).silenced_until = until
        register_worker(session, "local-0", 1)
    labels = {"webhook_id": hook["id"], "webhook_name": 'the "pager"\\'}
    found = scrape(post_room.http)
    assert value(found, "surefoot_alert_silenced", camera_id="corner", kind="drift") == 1
    name = "surefoot_alert_silenced"
    assert (name, ("camera_id", "corner"), ("kind", "no_data")) not in found
    assert value(found, "surefoot_alert_firing", camera_id="corner", kind="no_data") == 1
    assert value(found, "surefoot_deliveries_pending", **labels) == 2
    assert value(found, "surefoot_delivery_oldest_pending_seconds", **labels) > 0
    assert value(found, "surefoot_webhook_failing_seconds", **labels) == 0
    assert value(found, "surefoot_webhook_enabled", **labels) == 1
    beat = value(found, "surefoot_worker_last_heartbeat_timestamp_seconds", worker="local-0")
    assert beat == pytest.approx(datetime.now(UTC).timestamp(), abs=60)
    post_room.send(hook)
    post_room.change(hook, enabled=False)
    found = scrape(post_room.http)
    assert value(found, "surefoot_webhook_failing_seconds", **labels) > 0
    assert value(found, "surefoot_webhook_enabled", **labels) == 0


def test_requests_are_counted_by_the_template_of_their_route(corner):
    for path in ("/cameras/corner", "/cameras/corner", "/cameras/nobody", "/what/ever/17"):
        corner.get(path)
    corner.request("BREW", "/cameras/corner")
    found = scrape(corner)
    name, route = "surefoot_http_requests_total", "/cameras/{camera_id}"
    assert value(found, name, method="GET", route=route, status="200") == 2
    assert value(found, name, method="GET", route=route, status="404") == 1
    assert value(found, name, method="GET", route="unmatched", status="404") == 1
    assert value(found, name, method="POST", route="/cameras", status="201") == 1
    name = "surefoot_http_request_duration_seconds_count"
    assert value(found, name, method="GET", route=route) == 3
    labels = {item for key in found for item in key[1:]}
    assert not [item for item in labels if "corner" in item[1] and item[0] == "route"]
    assert ("method", "other") in labels
    assert ("method", "BREW") not in labels


def test_two_applications_do_not_share_their_counts(http, settings):
    http.get("/healthz")
    with TestClient(create_app(settings)) as other:
        found = scrape(other)
    assert ("route", "/healthz") not in {item for key in found for item in key[1:]}


def test_open_metrics_where_it_is_asked_for(bench):
    accept = {"Accept": "application/openmetrics-text; version=1.0.0"}
    answer = bench.http.get("/metrics", headers=accept)
    assert answer.headers["content-type"].startswith("application/openmetrics-text")
    names = {family.name for family in open_families(answer.text)}
    assert {"surefoot_cameras", "surefoot_events", "surefoot_build"} <= names
    problem(bench.http.post("/metrics"), 405, "method_not_allowed")


@needs_promtool
def test_promtool_finds_nothing_to_say(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    bench.http.post("/webhooks", json={"url": "http://1.1.1.1/"}).raise_for_status()
    text = bench.http.get("/metrics").content
    checked = subprocess.run(
        [PROMTOOL, "check", "metrics"], input=text, capture_output=True, check=False
    )
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, b"", b"")
