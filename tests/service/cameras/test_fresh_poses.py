"""Poses as they are answered: what the store and the clock say in that moment."""

import sqlite3
import subprocess
import sys
import threading
from datetime import UTC, datetime, timedelta

import pytest

from service.settings import Settings
from tests.service.bench import moved
from tests.service.conftest import problem
from tests.service.shifted_clock import ShiftedClock
from tests.stores.databases import only_sqlite

pytestmark = only_sqlite("changes the file from elsewhere")

URL = "/cameras/corner/pose"


@pytest.fixture
def clock():
    with ShiftedClock() as made:
        yield made


def elsewhere(settings: Settings, statement: str) -> None:
    """Change the store in another process, as a worker does."""
    words = (
        "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute(sys.argv[2]); c.commit()"
    )
    path = str(settings.database_path)
    subprocess.run([sys.executable, "-c", words, path, statement], check=True)


def test_who_asks_again_is_told_the_same(corner):
    first, again = corner.get(URL), corner.get(URL)
    assert (again.content, again.headers["etag"]) == (first.content, first.headers["etag"])
    assert again.headers["content-type"] == "application/json"
    same = corner.get(URL, headers={"If-None-Match": f'"other", {first.headers["etag"]}'})
    assert (same.status_code, same.content) == (304, b"")


def test_a_query_changes_nothing(corner):
    first = corner.get(URL)
    queried = corner.get(URL, params={"at": "now"})
    assert (queried.content, queried.headers["etag"]) == (first.content, first.headers["etag"])
    headers = {"If-None-Match": first.headers["etag"]}
    assert corner.get(URL, params={"at": "now"}, headers=headers).status_code == 304


def test_what_another_process_writes_is_told_at_once(corner, settings):
    before = corner.get(URL)
    elsewhere(settings, "UPDATE prior_poses SET height_m = 7.25")
    after = corner.get(URL)
    assert after.json()["pose"]["height_m"] == 7.25
    assert after.headers["etag"] != before.headers["etag"]


def test_what_the_service_itself_writes_is_told_at_once(bench):
    bench.see(moved())
    assert bench.pose()["state"] == "ok"
    bench.see(moved(tilt_deg=6.0))
    assert bench.pose()["state"] == "drifting"
    bench.http.post("/cameras/corner/pose/put-back", json={}).raise_for_status()
    assert bench.pose()["state"] == "learning"


def test_a_camera_that_is_gone_is_gone(corner):
    assert corner.get(URL).status_code == 200
    etag = corner.get("/cameras/corner").headers["etag"]
    assert corner.delete("/cameras/corner", headers={"If-Match": etag}).status_code == 204
    problem(corner.get(URL), 404, "not_found")
    problem(corner.get(URL, params={"at": "now"}), 404, "not_found")


def test_a_window_that_begins_and_ends_by_the_clock_is_told(corner, clock):
    now = datetime.now(UTC)
    times = {"from": now + timedelta(hours=1), "to": now + timedelta(hours=2)}
    body = {name: at.isoformat() for name, at in times.items()}
    corner.post("/cameras/corner/maintenance", json=body).raise_for_status()
    codes = []
    for hours in (0, 0, 1.5, 1.5, 2.5, 0):  # and back: clocks are set back, too
        clock.ahead = timedelta(hours=hours)
        codes.append(corner.get(URL).json()["reason_code"])
    nobody = "nobody_posted"
    assert codes == [nobody, nobody, "maintenance", "maintenance", nobody, nobody]


def test_silence_comes_by_the_clock_and_grows(bench, clock):
    bench.see(moved())
    told = []
    for hours in (0, 0, 48, 49):
        clock.ahead = timedelta(hours=hours)
        told.append(bench.pose())
    assert [body["state"] for body in told] == ["ok", "ok", "no_data", "no_data"]
    assert told[3]["reason_values"]["silent_s"] - told[2]["reason_values"]["silent_s"] > 3600


def test_many_who_ask_while_it_changes_are_never_told_of_before(corner, settings):
    """Each answer is at least as new as what had been committed when it was asked for."""
    done = threading.Event()
    wrong: list[tuple[float, float]] = []
    committed = [6.0]

    def ask() -> None:
        while not done.is_set():
            least = committed[0]
            got = corner.get(URL).json()["pose"]["height_m"]
            if got < least:
                wrong.append((least, got))

    asking = [threading.Thread(target=ask) for _ in range(4)]
    for thread in asking:
        thread.start()
    with sqlite3.connect(settings.database_path, isolation_level=None, timeout=30) as connection:
        for n in range(150):
            connection.execute("UPDATE prior_poses SET height_m = ?", (6.0 + n / 100,))
            committed[0] = 6.0 + n / 100
    done.set()
    for thread in asking:
        thread.join()
    assert not wrong
