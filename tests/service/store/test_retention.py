"""What is beyond each limit goes until nothing is, and the file shrinks."""

import os
import threading
import time
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import text

from service.job_queue import JobQueue
from service.store.engines.store import Store, engine_for
from service.workers.context import JobContext
from service.workers.upkeep.retention import BITE, run_retention
from tests.running import wait_for
from tests.stores.databases import only_sqlite
from tests.stores.rows import put_rows, row_of

DAY = timedelta(days=1)


def when(days_ago):
    return str((datetime.now(UTC) - days_ago * DAY).replace(tzinfo=None))


def put(connection, table, **values):
    put_rows(connection, table, [row_of(table, **values)])


@pytest.fixture
def room(settings):
    made = Room(settings)
    yield made
    made.engine.dispose()


class Room:
    """A camera, rows without number, and retention."""

    def __init__(self, settings):
        self.settings = settings
        self.engine = engine_for(settings.store_url)
        with self.connected() as connection:
            put(connection, "cameras", id="corner")
            put(connection, "prior_poses", camera_id="corner")
            put(connection, "site_references", camera_id="corner", prior_pose_id=1)

    def connected(self):
        return self.engine.begin()

    def fill(self, table, rows, **values):
        """Insert many rows at once; values that are functions are called with each number."""
        made = [
            row_of(table, **{name: v(n) if callable(v) else v for name, v in values.items()})
            for n in range(rows)
        ]
        with self.connected() as connection:
            put_rows(connection, table, made)

    def tracks(self, rows, *, first=0, size=100, days_ago=0.0):
        now_s = time.time() - days_ago * 86_400
        self.fill(
            "tracks", rows, camera_id="corner", source="s", track_id=lambda n: str(first + n),
            started_s=now_s, ended_s=now_s, received_at=when(days_ago), points=b"x" * size,
        )  # fmt: skip

    def count(self, table, where="1 = 1"):
        with self.connected() as connection:
            return connection.scalar(text(f"SELECT count(*) FROM {table} WHERE {where}"))

    def size(self):
        if self.settings.database_url is not None:
            return None  # the server's disk is not ours to shrink
        folder = self.settings.data_dir
        return sum(path.stat().st_size for path in folder.glob("surefoot.sqlite*"))

    def retain(self, **limits):
        settings = self.settings.model_copy(update=limits)
        store = Store(settings)
        run_retention(JobContext(settings=settings, store=store, queue=JobQueue(store.engine)))
        store.close()


@pytest.mark.nightly
def test_fifteen_thousand_tracks_go_down_to_what_is_said_and_so_does_the_file(room):
    room.tracks(15_200, size=2000)
    full = room.size()
    assert full is None or full > 30e6
    room.retain(keep_tracks=200)
    assert room.count("tracks") == 200
    assert room.count("tracks", "length(track_id) = 5 AND track_id >= '15000'") == 200
    assert full is None or room.size() < 3e6
    room.retain(keep_tracks=200)
    assert room.count("tracks") == 200


def test_old_tracks_go_however_many(room):
    room.tracks(5_001, days_ago=31)
    room.tracks(10, first=10_000, days_ago=29)
    room.retain()
    assert room.count("tracks") == 10


def test_tracks_are_limited_by_their_bytes_and_the_newest_stay(room):
    room.tracks(1_500, size=2_000)
    room.tracks(1, first=5_000, size=400_000)
    room.retain(keep_mb=0)  # any
    assert room.count("tracks") == 1_501
    room.retain(keep_mb=1.0)
    assert room.count("tracks") == 1 + (2**20 - 400_000) // 2_000
    assert room.count("tracks", "track_id = '5000'") == 1
    room.retain(keep_mb=0.1)
    assert room.count("tracks") == 0


def test_posts_come_between_the_bites(room):
    room.tracks(15_000)
    seen = []

    def post():
        while not seen or seen[-1] > 200:
            with room.connected() as connection:
                put(connection, "events", type="pose", payload="{}")
                seen.append(connection.scalar(text("SELECT count(*) FROM tracks")))

    poster = threading.Thread(target=post)
    poster.start()
    wait_for(lambda: seen)
    room.retain(keep_tracks=100)
    poster.join(30)
    between = {count for count in seen if 100 < count < 15_000}
    assert len(between) > 3
    assert {count % BITE for count in between} <= {0, 100}  # 15,000 less whole bites


@pytest.mark.parametrize(
    ("table", "limits", "kept", "values"),
    [
        ("events", {"keep_events": 300}, 300, {"type": "pose"}),
        ("estimates", {"keep_estimates": 300}, 300,
         {"camera_id": "corner", "prior_pose_id": 1, "reference_id": 1}),
        ("deliveries", {}, 0,
         {"webhook_id": "w", "id": lambda n: f"{n}", "state": "delivered",
          "finished_at": when(31)}),
        ("alerts", {}, 0,
         {"camera_id": "corner", "id": lambda n: f"{n}", "state": "resolved", "resolved_at":
          when(1826)}),
        ("trainings", {"keep_trainings": 20}, 20,
         {"camera_id": "corner", "id": lambda n: f"{n}", "prior_pose_id": 1, "state": "failed",
          "queued_at": lambda n: when(1 + n / 10_000)}),
        ("maintenance_windows", {}, 0,
         {"camera_id": "corner", "id": lambda n: f"{n}", "to_at": when(31)}),
        ("site_references", {"keep_references": 20}, 20,
         {"camera_id": "corner", "prior_pose_id": 1}),
        ("prior_poses", {"keep_references": 20}, 21, {"camera_id": "corner"}),
        ("activity", {}, 0, {"at": when(1826)}),
    ],
)  # fmt: skip
def test_each_table_has_a_limit_that_it_is_brought_down_to(room, table, limits, kept, values):
    with room.connected() as connection:
        put(connection, "webhooks", id="w")
    room.fill(table, 5_100, **values)
    room.retain(**limits)
    assert room.count(table) == kept


def test_young_and_firing_and_needed_rows_stay(room):
    with room.connected() as connection:
        put(connection, "webhooks", id="w", old_secret="old", old_secret_until=when(1))
        put(connection, "webhooks", id="v", old_secret="old", old_secret_until=when(-1))
        put(connection, "alerts", id="a", camera_id="corner", kind="drift", state="firing")
        put(connection, "alerts", id="b", camera_id="corner", state="resolved",
            resolved_at=when(1800))  # fmt: skip
        for number in range(30):
            put(connection, "site_references", camera_id="corner", prior_pose_id=1)
            put(connection, "trainings", id=f"t{number}", camera_id="corner", prior_pose_id=1,
                state="queued" if number == 0 else "succeeded",
                queued_at=when(100 - number))  # fmt: skip
        put(connection, "models", id="m", camera_id="corner", prior_pose_id=1, training_id="t1")
        put(connection, "estimates", camera_id="corner", prior_pose_id=1, reference_id=1)
    room.retain(keep_trainings=2, keep_references=2)
    assert room.count("alerts") == 2
    assert room.count("trainings") == 4  # the newest two, a queued one, a model's
    assert room.count("models") == 1
    assert room.count("site_references") == 3  # the newest two, an estimate's
    assert room.count("webhooks", "old_secret IS NOT NULL") == 1


def test_weights_that_no_model_names_go_once_they_are_old(room):
    used, unused = "1" * 64, "0" * 64
    with room.connected() as connection:
        put(connection, "trainings", id="t", camera_id="corner", prior_pose_id=1)
        put(connection, "models", id="m", camera_id="corner", prior_pose_id=1, training_id="t",
            weights_sha256=used)  # fmt: skip
    folder = room.settings.weights_dir
    folder.mkdir()
    for name in (f"{used}.safetensors", f"{unused}.safetensors", "new.safetensors"):
        (folder / name).write_bytes(b"")
        if name != "new.safetensors":
            os.utime(folder / name, (1, 1))
    room.retain()
    assert sorted(path.name for path in folder.iterdir()) == [
        f"{used}.safetensors",
        "new.safetensors",
    ]


@only_sqlite("a server has a log of its own")
def test_the_log_is_emptied(room):
    with Store(room.settings).read() as reading:  # keeps the log from going with the last user
        reading.connection().exec_driver_sql("SELECT 1 FROM cameras").fetchall()
        reading.rollback()
        room.tracks(2_000, size=3_000)
        log = room.settings.data_dir / "surefoot.sqlite-wal"
        assert log.stat().st_size > 3e6
        room.retain()
        assert log.stat().st_size == 0


def test_what_was_recorded_years_ago_and_came_now_stays(room):
    room.fill("tracks", 3, camera_id="corner", source="s", track_id=str, started_s=1.7e9,
              ended_s=1.7e9, received_at=when(0), points=b"x")  # fmt: skip
    room.fill("tracks", 2, camera_id="corner", source="s", track_id=lambda n: f"l{n}",
              started_s=time.time(), ended_s=time.time(), received_at=when(31),
              points=b"x")  # fmt: skip
    room.retain()
    assert room.count("tracks") == room.count("tracks", "started_s = 1.7e9") == 3
