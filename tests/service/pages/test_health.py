"""What is wrong with the service is said on every page, and since when."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import update

from service.enums import RunKind
from service.store import runs, webhooks, workers
from service.store.cameras import CameraRecord
from service.store.runs import RunTotal
from service.store.tracks import TrackRecord
from tests.conftest import track


def banner(http):
    return http.get("/ui/health/banner").text


def test_a_banner_says_what_is_wrong_and_since_when(corner, store):
    """`/readyz` at 503 and a webhook that failed for minutes stood nowhere."""
    assert "No worker runs: no camera is looked at." in banner(corner)
    now = datetime.now(UTC)
    with store.write() as session:
        workers.add(session, "one", 1, now)
    assert banner(corner).strip() == ""
    assert "All is well" in corner.get("/ui/health").text
    hook = corner.post("/webhooks", json={"url": "https://1.1.1.1/x", "name": "on call"}).json()
    corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]}).raise_for_status()
    ago = now - timedelta(minutes=7)
    with store.write() as session:
        session.get(workers.WorkerRecord, "one").heartbeat_at = ago
        record = session.get(webhooks.WebhookRecord, hook["id"])
        record.failing_since, record.last_error = ago, "timed out at https://1.1.1.1/x"
        camera = session.get(CameraRecord, "corner")
        camera.estimate_failing_since, camera.estimate_error = ago, "MemoryError"
    said = banner(corner)
    assert (
        f'No worker is heard of: no camera is looked at, since <time datetime="{ago.isoformat()}'
        in said
    )
    assert "The webhook “on call” takes nothing, since" in said
    assert "Looks at corner fail, since" in said
    page = corner.get("/ui/health").text
    assert "MemoryError" in page
    assert "1.1.1.1" not in said + page  # an address may hold a secret, and many read this
    assert "Takes nothing since" in corner.get("/ui/webhooks").text


def test_tracks_that_wait_are_told_since_when(corner, store):
    with store.write() as session:
        workers.add(session, "one", 1, datetime.now(UTC))
    corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]}).raise_for_status()
    assert banner(corner).strip() == ""  # for a minute, that is usual
    with store.write() as session:
        session.execute(
            update(TrackRecord).values(received_at=datetime.now(UTC) - timedelta(minutes=5))
        )
    assert "Tracks wait to be looked at, since" in banner(corner)


def test_health_page_shows_ages_runs_and_cpu_time(corner, store):
    empty = corner.get("/ui/health").text
    assert "The queue is empty: every track has been monitored." in empty
    assert empty.count("No results yet") == 2
    now = datetime.now(UTC)
    corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]}).raise_for_status()
    with store.write() as session:
        session.execute(update(TrackRecord).values(received_at=now - timedelta(seconds=60)))
        camera = session.get(CameraRecord, "corner")
        camera.read_track_pk = session.query(TrackRecord.id).scalar()
        camera.checked_at = now - timedelta(seconds=51)
        runs.add(session, {RunKind.MONITOR: RunTotal(runs=7, cpu_s=9.0)}, now - timedelta(hours=24))
        runs.add(session, {RunKind.MONITOR: RunTotal(runs=200, cpu_s=1.2)}, now)
    page = corner.get("/ui/health").text
    age, cpu = (row for row in page.split("<tr>") if "<td>Monitoring</td>" in row)
    assert age.count('<td class="number" translate="no">9 seconds</td>') == 3
    for text in ("200", "1.2 s", "6.0 ms"):
        assert f'<td class="number">{text}</td>' in cpu
    assert 'class="line" d="M0 23.0' in cpu  # nothing before
    assert '<circle cx="96" cy="4.8"' in cpu  # this hour is the maximum
    assert 'class="limit"' not in cpu
    german = corner.get("/ui/health", headers={"Accept-Language": "de"}).text
    assert "9 Sekunden" in german
    assert "1,2 s" in german
    assert "Alter der Ergebnisse" in german


def test_health_page_counts_cameras_in_the_queue(corner):
    corner.post("/cameras/corner/tracks", json={"tracks": [track("1")]}).raise_for_status()
    assert "1 camera has new tracks in the queue" in corner.get("/ui/health").text
