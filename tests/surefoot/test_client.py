"""The edge client: alone on the standard library, before a service that comes and goes."""

import json
import re
import subprocess
import sys
import tempfile
import threading
import time
import types
from collections import Counter
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from surefoot import client as module
from surefoot.client import Client
from tests.conftest import CAMERA, ROOT
from tests.running import free_port, served, wait_for
from tests.test_docs_python import code


@pytest.fixture
def server(tmp_path, migrated):
    with served(tmp_path, migrated) as running:
        running.http.post("/cameras", json=CAMERA).raise_for_status()
        yield running


@pytest.fixture
def soon(monkeypatch):
    """Waits are too short to be waited for."""
    monkeypatch.setattr(module, "_TICK_S", 0.02)
    monkeypatch.setattr(module, "_SHORTEST_WAIT_S", 0.02)
    monkeypatch.setattr(module, "_LONGEST_WAIT_S", 0.05)


class Stub:
    """A service that answers with what it was told, the last for ever; `seen` are the posts."""

    def __init__(self, *answers, port=0):
        self.seen = seen = []
        answers = list(answers)

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                seen.append((self.headers.get("Authorization"), json.loads(body)))
                status, headers = answers.pop(0) if len(answers) > 1 else answers[0]
                tracks = len(seen[-1][1]["tracks"])
                receipt = {"accepted": tracks, "duplicates": 0, "rejected": []}
                content = json.dumps(receipt).encode()
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}"
        self.thread = threading.Thread(target=self.server.serve_forever, daemon=True)
        self.thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


OK = (202, {})


def walk(client, name, start_s, count=10):
    for n in range(count):
        client.add(name, (300 + 9 * n, 200, 360 + 9 * n, 400), start_s + 0.4 * n)


def stored(server):
    store = Store(server.settings)
    try:
        with store.read() as session:
            return [
                (each.source, each.track_id, unpack(each.points, 3), unpack(each.boxes, 4))
                for each in session.query(TrackRecord).order_by(TrackRecord.track_id)
            ]
    finally:
        store.close()


def test_a_loop_of_detections_is_stored_as_tracks(server, soon):
    start_s = time.time() - 60
    with Client(server.url, "corner", source="loop", camera_size=(1280, 720), size=(640, 360)) as c:
        for n in range(10):  # two at once, as frames have them
            c.add(1, (150 + n, 100, 180 + n, 200), start_s + 0.4 * n)
            c.add(2, (250 + n, 100, 280 + n, 200), start_s + 0.4 * n)
        c.add(1, (150, 100, 180, 200), start_s + 60)  # somebody else, long after
    assert c.posted == Counter(accepted=2, refused=1)  # who was seen once is too short
    assert c.waiting == 0
    assert abs(c.clock_ahead_s) < 30  # of one machine: what a busy one takes to answer
    (source, name, points, boxes), _ = stored(server)
    assert (source, name) == ("loop", "1")
    assert boxes[0].tolist() == [300.5, 200.5, 360.5, 400.5]  # of twice as many pixels
    assert points[0].tolist() == pytest.approx([start_s, 330.5, 400.5])


def test_what_a_service_that_is_away_missed_is_stored_once_it_is_back(tmp_path, migrated, soon):
    port, spool = free_port(), tmp_path / "spool"
    start_s = time.time() - 500
    for run in range(2):  # and the client is started anew meanwhile
        with Client(f"http://127.0.0.1:{port}", "corner", spool=spool) as away:
            walk(away, f"of run {run}", start_s + 100 * run)
        assert (away.posted, away.waiting) == (Counter(), run + 1)
    with served(tmp_path, migrated) as server:
        server.http.post("/cameras", json=CAMERA).raise_for_status()
        with Client(server.url, "corner", spool=spool) as back:
            wait_for(lambda: back.waiting == 0, timeout_s=10, every_s=0.02)
            walk(back, "of run 0", start_s)  # a tracker that was started anew says it twice
        assert back.posted == Counter(accepted=2, duplicates=1)
        assert [name for _, name, *_ in stored(server)] == ["of run 0", "of run 1"]


def test_a_full_spool_loses_the_oldest_and_counts_them(tmp_path, soon):
    with Stub((503, {})) as stub:
        client = Client(stub.url, "corner", spool=tmp_path, spool_mb=0.005)
        for n in range(20):
            walk(client, str(n), 1_000.0 + 100 * n)
            client.end(n)
            wait_for(lambda n=n: client.waiting + client.posted["lost"] == n + 1, every_s=0.01)
        client.close()
    files = sorted(tmp_path.glob("*.json"))
    assert sum(file.stat().st_size for file in files) <= 5_000
    left = [json.loads(file.read_text())["tracks"][0]["id"] for file in files]
    assert left == [str(n) for n in range(20 - len(left), 20)]
    assert client.posted == Counter(lost=20 - len(left))


def test_it_waits_longer_each_time_and_as_long_as_it_is_asked_to(monkeypatch, soon, tmp_path):
    monkeypatch.setattr(module, "_LONGEST_WAIT_S", 2.0)
    answers = [(503, {}), (500, {}), (401, {}), (429, {"Retry-After": "1"}), OK]
    with Stub(*answers) as stub, Client(stub.url, "corner", token="sf_x", spool=tmp_path) as client:
        walk(client, "a", 1_000.0)
        client.end("a")
        wait_for(lambda: client.posted["accepted"], timeout_s=10, every_s=0.02)
    assert [token for token, _ in stub.seen] == ["Bearer sf_x"] * 5
    assert len({json.dumps(body) for _, body in stub.seen}) == 1


def test_what_can_never_be_taken_is_given_up_and_a_redirect_gets_no_token(soon, tmp_path):
    with Stub(OK) as elsewhere:
        moved = (302, {"Location": f"{elsewhere.url}/here"})
        with Stub(moved, (422, {}), OK) as stub, Client(stub.url, "c", spool=tmp_path) as client:
            walk(client, "a", 1_000.0)
            client.end("a")
            wait_for(lambda: client.posted["refused"], every_s=0.02)
            walk(client, "b", 2_000.0)
        assert elsewhere.seen == []
    assert client.posted == Counter(refused=1, accepted=1)


def test_a_body_says_what_picture_its_boxes_are_of(soon, tmp_path):
    for given, said in (
        ({"size": (640, 360)}, {"size": [640, 360]}),
        ({"normalised": True}, {"normalised": True}),
        ({}, {}),
        ({"normalised": True, "camera_size": (1280, 720)}, {}),
    ):
        with Stub(OK) as stub, Client(stub.url, "corner", spool=tmp_path, **given) as client:
            client.add("a", (0.0, 0.0, 0.5, 1.0), 5.0)
        ((_, body),) = stub.seen
        (track,) = body.pop("tracks")
        assert body == {"source": "tracker", **said}
        scaled = [-0.5, -0.5, 639.5, 719.5] if "camera_size" in given else [0, 0, 0.5, 1]
        assert track["boxes"] == [[5.0, *scaled]]


def test_a_track_is_never_longer_than_the_service_takes(monkeypatch, soon, tmp_path):
    monkeypatch.setattr(module, "_MAX_POINTS", 10)
    monkeypatch.setattr(module, "_FILE_POINTS", 25)
    with Stub(OK) as stub, Client(stub.url, "corner", spool=tmp_path, silence_s=60) as client:
        walk(client, "stands", 1_000.0, count=57)
        walk(client, "stands", 1_000.0, count=57)  # again, or out of order: nothing new
        client.add("stands", (float("nan"), 0, 1, 1), 2_000.0)
    sizes = [len(track["boxes"]) for _, body in stub.seen for track in body["tracks"]]
    assert sorted(sizes) == [7, 10, 10, 10, 10, 10]
    assert all(sum(len(t["boxes"]) for t in body["tracks"]) <= 25 for _, body in stub.seen)


def test_spool_with_files_of_others_is_used_and_they_are_left_alone(soon, tmp_path):
    spool = tmp_path / "spool"
    spool.mkdir()
    others = ("1a-2.json", "7-2x.json", "000000000009-1.json.bak", "notes.txt", "5-.json")
    for name in others:
        (spool / name).write_text("not ours")
    with Stub(OK) as stub, Client(stub.url, "corner", spool=spool) as client:
        walk(client, "1", time.time() - 60)
    assert client.posted == Counter(accepted=1)
    assert sorted(path.name for path in spool.iterdir()) == sorted(others)


def test_file_of_the_spool_that_cannot_be_read_does_not_hold_up_the_others(soon, tmp_path):
    spool = tmp_path / "spool"
    (spool / "000000000001-3.json").mkdir(parents=True)
    with Stub(OK) as stub, Client(stub.url, "corner", spool=spool) as client:
        walk(client, "1", time.time() - 60)
    assert client.posted == Counter(accepted=1, lost=3)
    assert client.waiting == 0


@pytest.mark.parametrize("content", [b"", b"\0" * 500, b'{"source": "x", "tracks": [{"id"'])
def test_file_of_the_spool_that_is_cut_off_is_rejected_and_the_next_is_stored(
    server, soon, tmp_path, content
):
    spool = tmp_path / "spool"
    spool.mkdir()
    (spool / "000000000001-2.json").write_bytes(content)
    with Client(server.url, "corner", spool=spool) as client:
        walk(client, "1", time.time() - 60)
    assert client.posted == Counter(accepted=1, refused=2)
    assert list(spool.iterdir()) == []


def test_spool_that_is_deleted_under_way_is_made_again(soon, tmp_path):
    spool = tmp_path / "spool"
    with Stub(OK) as stub, Client(stub.url, "corner", spool=spool) as client:
        spool.rmdir()
        walk(client, "1", time.time() - 60)
    assert client.posted == Counter(accepted=1)


def test_fault_of_the_spool_does_not_end_the_thread(soon, tmp_path, monkeypatch):
    spool, faults = tmp_path / "spool", [OverflowError("once")]
    keep = Client._keep_finished

    def faulty(client):
        if faults:
            raise faults.pop()
        keep(client)

    monkeypatch.setattr(Client, "_keep_finished", faulty)
    with Stub(OK) as stub, Client(stub.url, "corner", spool=spool) as client:
        wait_for(lambda: not faults, every_s=0.02)
        walk(client, "1", time.time() - 60)
        client.end("1")
        wait_for(lambda: client.posted == Counter(accepted=1), every_s=0.02)


def test_only_a_web_address_is_one():
    with pytest.raises(ValueError, match="http"):
        Client("file:///etc", "corner")


def test_the_file_that_is_served_stands_alone(server, tmp_path):
    answer = server.http.get("/client.py")
    assert answer.text == (ROOT / "surefoot" / "client.py").read_text()
    assert answer.headers["content-type"].startswith("text/x-python")
    (tmp_path / "client.py").write_text(answer.text)
    program = f"""
import sys, time
sys.path.insert(0, {str(tmp_path)!r})
from client import Client
with Client({server.url!r}, "corner") as client:
    for n in range(10):
        client.add(7, (300 + n, 200, 360 + n, 400), time.time() - 60 + 0.4 * n)
foreign = {{"numpy", "models", "surefoot"}} & {{name.partition(".")[0] for name in sys.modules}}
print(client.posted["accepted"], foreign)
"""
    alone = [sys.executable, "-I", "-S", "-c", program]  # without any installed package
    ran = subprocess.run(alone, capture_output=True, text=True, check=True, timeout=60)
    assert ran.stdout.split() == ["1", "set()"]


class Tensor(np.ndarray):
    """What has `tolist`, as torch's tensors have."""


def results(count):
    """What Ultralytics' `track` yields, by its classes' shape: `boxes` with `id` and `xyxyn`."""
    yield types.SimpleNamespace(boxes=types.SimpleNamespace(id=None, xyxyn=np.empty((0, 4))))
    for n in range(count):
        xyxyn = np.array([[0.3 + 0.01 * n, 0.4, 0.35 + 0.01 * n, 0.7]]).view(Tensor)
        boxes = types.SimpleNamespace(id=np.array([17.0]).view(Tensor), xyxyn=xyxyn)
        yield types.SimpleNamespace(boxes=boxes)


def test_the_example_of_the_docs_posts_what_ultralytics_tracks(monkeypatch, soon, tmp_path):
    asked = []

    class YOLO:
        def __init__(self, weights):
            asked.append(weights)

        def track(self, address, **options):
            asked.append((address, options))
            return results(8)

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setitem(sys.modules, "client", module)
    monkeypatch.setitem(sys.modules, "ultralytics", types.SimpleNamespace(YOLO=YOLO))
    with Stub(OK) as stub:
        program = code("guides/trackers.md")
        assert program.count("http://127.0.0.1:8080") == 1
        program = program.replace("http://127.0.0.1:8080", stub.url)
        exec(compile(program, "docs/guides/trackers.md", "exec"), {})  # noqa: S102
    assert asked[1][1] == {"stream": True, "classes": [0]}
    ((_, body),) = stub.seen
    assert (body["source"], body["normalised"]) == ("yolo11", True)
    (track,) = body["tracks"]
    assert (track["id"], len(track["boxes"])) == ("17", 8)
    assert len(re.findall(r"\S.*", program)) <= 10
    assert list(tmp_path.iterdir()) == []  # nothing waits: its spool is gone, too


def test_supervisions_detections_are_taken_as_they_are(soon, tmp_path):
    with Stub(OK) as stub, Client(stub.url, "c", spool=tmp_path, size=(640, 360)) as client:
        for n in range(5):
            xyxy = np.array([[1, 2, 3, 4], [5, 6, 7, 8]], dtype=np.float32)
            detections = types.SimpleNamespace(xyxy=xyxy, tracker_id=np.array([3, 4]))
            for track_id, box in zip(detections.tracker_id, detections.xyxy, strict=True):
                client.add(track_id, box, 100.0 + n)
    ((_, body),) = stub.seen
    assert {track["id"]: track["boxes"][0] for track in body["tracks"]} == {
        "3": [100.0, 1, 2, 3, 4], "4": [100.0, 5, 6, 7, 8],
    }  # fmt: skip


def test_client_posts_the_class_of_most_detections_and_counts_what_is_skipped(server, soon):
    start_s = time.time() - 60
    with Client(server.url, "corner") as client:
        for n in range(10):
            box = (150 + n, 100, 180 + n, 200)
            for name, label in (("a", "person"), ("b", 2), ("c", 0.0), ("d", None)):
                client.add(name, box, start_s + 0.4 * n, label="car" if n == 4 else label)
    assert client.posted == Counter(accepted=3, skipped=1)
    assert client.skipped == Counter(not_a_person=1)
    assert [name for _, name, *_ in stored(server)] == ["a", "c", "d"]
