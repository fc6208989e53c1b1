"""What Frigate has stored and no broker has brought: asked for page by page, once."""

import contextlib
import json
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest

from service.settings import Settings
from surefoot.bridge import frigate_history
from surefoot.bridge import inbox as inbox_module
from surefoot.bridge.broker import Address
from surefoot.bridge.feeds import Topics
from surefoot.bridge.frigate_history import History, HistoryError
from surefoot.bridge.inbox import Inbox
from surefoot.bridge.run import Bridge
from surefoot.bridge.spool import Spool
from tests.running import wait_for
from tests.surefoot.bridge.halves import inward
from tests.surefoot.bridge.stand import (
    Client5,
    broker,
    frigate_event,
    needs_mosquitto,
)

T0 = 1_700_000_000.0
TOPICS = Topics(prefix="surefoot", frigate="frigate", cameras={})
GOING_ON = threading.Event()


def path_from(start_s):
    return [[[0.3 + 0.02 * n, 0.5 + 0.02 * n], start_s + n] for n in range(8)]


def stored_event(name, start_s, camera="corner", **more):
    """An event as Frigate's database has it."""
    event = {
        "id": name, "camera": camera, "label": "person", "sub_label": None, "zones": [],
        "start_time": start_s, "end_time": start_s + 7.0, "has_clip": True, "has_snapshot": True,
        "false_positive": None, "box": None, "top_score": None, "plus_id": None,
        "retain_indefinitely": False,
        "data": {"type": "object", "score": 0.8, "box": [0.4, 0.2, 0.1, 0.3],
                 "path_data": path_from(start_s)},
    }  # fmt: skip
    return event | more


class Frigate:
    """A server that answers `/api/events` as Frigate's does, out of a list."""

    def __init__(self):
        self.events, self.asked, self.failures = [], [], {}
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                address = urlsplit(self.path)
                query = {name: values[0] for name, values in parse_qs(address.query).items()}
                outer.asked.append((address.path, query))
                failure = outer.failures.pop(len(outer.asked), None)
                if failure is not None:
                    self.answer(500, b"Internal Server Error" if failure is True else failure)
                    return
                found = [
                    event
                    for event in sorted(outer.events, key=lambda event: event["start_time"])
                    if event["start_time"] > float(query["after"])
                    and event["label"] in query["labels"].split(",")
                    and (event["end_time"] is None) == (query["in_progress"] == "1")
                ]
                assert query["sort"] == "date_asc"
                self.answer(200, json.dumps(found[: int(query["limit"])]).encode())

            def answer(self, status, body):
                self.send_response(status)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}"


@pytest.fixture
def frigate():
    running = Frigate()
    thread = threading.Thread(target=running.server.serve_forever, args=(0.02,))
    thread.start()
    yield running
    running.server.shutdown()
    running.server.server_close()
    thread.join()


@pytest.fixture
def spool(tmp_path):
    with contextlib.closing(Spool(tmp_path / "bridge.sqlite", 2**20)) as spool:
        spool.keep(0.0, None, [], marks={"frigate": T0})
        yield spool


@pytest.fixture
def history(spool, monkeypatch):
    monkeypatch.setattr(frigate_history, "PAGE", 4)
    return History(spool=spool, camera_of=TOPICS.camera_of)


def fill(history, frigate):
    with httpx.Client(base_url=frigate.url) as http:
        history.fill(http, GOING_ON)


def kept(spool):
    tracks = []
    while (group := spool.next((), ())) is not None:
        head = json.loads(group.head)
        assert head == {"source": "frigate", "normalised": True}
        tracks += [json.loads(each) for each in group.tracks.values()]
        spool.drop(group)
    return tracks


def test_pages_bring_everybody_once_as_mqtt_would(frigate, history, spool):
    # Of a page's length and more, some of which start in one frame.
    frigate.events = [stored_event(f"e{n}", T0 + 10.0 * (n // 6)) for n in range(33)]
    fill(history, frigate)
    tracks = kept(spool)
    assert sorted(each["id"] for each in tracks) == sorted(f"e{n}" for n in range(33))
    end = frigate_event("end", "e0", "corner", path_from(T0))
    _, (by_mqtt,) = TOPICS.read("frigate/events", json.dumps(end).encode())
    assert json.loads(by_mqtt.to_json()) == next(each for each in tracks if each["id"] == "e0")
    path, query = frigate.asked[0]
    assert path == "/api/events"
    assert {name: query[name] for name in ("labels", "include_thumbnails", "in_progress")} == {
        "labels": "person", "include_thumbnails": "0", "in_progress": "0",
    }  # fmt: skip
    assert T0 - float(query["after"]) >= 3600.0  # who came an hour ago may have left just now
    assert spool.mark("frigate") == T0 + 57.0
    # From there on the next time: nobody but those around the mark again.
    fill(history, frigate)
    assert {each["id"] for each in kept(spool)} == {f"e{n}" for n in range(33)}
    frigate.events += [stored_event("new", T0 + 2000.0), stored_event("newer", T0 + 9000.0)]
    fill(history, frigate)
    kept(spool)
    fill(history, frigate)
    assert [each["id"] for each in kept(spool)] == ["newer"]


def test_after_an_error_in_mid_way_it_goes_on_where_it_was(frigate, history, spool):
    frigate.events = [stored_event(f"e{n}", T0 + n) for n in range(11)]
    frigate.failures = {2: True}
    with pytest.raises(HistoryError, match="500"):
        fill(history, frigate)
    assert spool.mark("frigate") == T0
    assert len(kept(spool)) == 4
    fill(history, frigate)
    assert sorted(each["id"] for each in kept(spool)) == sorted(f"e{n}" for n in range(4, 11))
    assert spool.mark("frigate") == T0 + 17.0


def test_what_is_no_path_is_named_and_the_others_are_kept(frigate, history, spool, caplog):
    by_hand = stored_event("hand", T0 + 1.0, data={"type": "api", "score": 0})
    odd = stored_event("odd", T0 + 2.0)
    odd["data"]["path_data"] = [[1, 2, 3]]
    frigate.events = [
        stored_event("e0", T0), by_hand, odd, stored_event("nothing", T0 + 2.5, data=None),
        stored_event("wrong", T0 + 3.0, camera="Not an id"), stored_event("e1", T0 + 4.0),
        stored_event("false", T0 + 5.0, false_positive=True),
        stored_event("lasts", T0 + 6.0, end_time=None), stored_event("car", T0, label="car"),
    ]  # fmt: skip
    with caplog.at_level("INFO"):
        fill(history, frigate)
    assert [each["id"] for each in kept(spool)] == ["e0", "e1"]
    told = next(record for record in caplog.records if record.message == "frigate_asked")
    assert told.refused == {"malformed": 4}
    assert "hand: data.path_data" in told.first


@pytest.mark.parametrize("answer", [b"no JSON", b"{}", b"x" * 3000])
def test_an_answer_that_is_none_is_told(frigate, history, monkeypatch, answer):
    monkeypatch.setattr(frigate_history, "MAX_ANSWER_BYTES", 2000)
    transport = httpx.MockTransport(lambda _: httpx.Response(200, content=answer))
    with (
        httpx.Client(base_url=frigate.url, transport=transport) as http,
        pytest.raises(HistoryError, match="bytes" if len(answer) > 2000 else "malformed|events"),
    ):
        history.fill(http, GOING_ON)


def test_the_mark_moves_with_mqtt_unless_somebody_may_be_missing(
    frigate, history, spool, monkeypatch
):
    monkeypatch.setattr(inbox_module, "_GATHER_S", 0.0)
    monkeypatch.setattr(frigate_history, "_SETTLE_S", 0.0)
    inbox = Inbox(lambda _: None)
    reading = inward(inbox, spool, topics=TOPICS, whole=history.whole)

    def end(name, start_s):
        message = json.dumps(frigate_event("end", name, "corner", path_from(start_s))).encode()
        inbox.add("frigate/events", message, 0, 0)
        reading._step(inbox.take(0.0), start_s + 100.0)

    history.note_connection(True)
    end("1", T0 + 50.0)
    assert spool.mark("frigate") == T0
    stopping = threading.Event()
    thread = threading.Thread(target=history.run, args=(frigate.url, stopping))
    thread.start()
    wait_for(history.whole, every_s=0.01)
    stopping.set()
    thread.join()
    end("2", T0 + 100.0)
    assert spool.mark("frigate") == T0 + 107.0
    end("from a clock that runs ahead", T0 + 9e6)
    history.note_connection(False)
    end("3", T0 + 1e8)
    assert spool.mark("frigate") == T0 + 9e6 + 7.0


@pytest.mark.parametrize(
    "url", ["ftp://host", "http://", "host:5000", "http://me:it@host", "http://host/?a=1"]
)
def test_an_address_that_is_none_is_refused(url):
    with pytest.raises(ValueError, match="http://host:port"):
        Settings(mqtt_frigate_url=url)


@contextlib.contextmanager
def running(spool, port, frigate):
    """A bridge whose service is away: what it has kept stays in the spool."""
    stopping, before = threading.Event(), threading.active_count()
    bridge = Bridge(
        address=Address(url=f"mqtt://127.0.0.1:{port}", client_id="bridge"), topics=TOPICS,
        spool=spool, frigate_url=frigate.url, url="http://127.0.0.1:1", token=None,
        discovery=None, version="0",
    )  # fmt: skip
    thread = threading.Thread(target=bridge.run, args=(stopping,))
    thread.start()
    yield
    stopping.set()
    thread.join()
    # Its parts have the spool until they have seen that it stops.
    wait_for(lambda: threading.active_count() <= before, every_s=0.02)


@pytest.mark.slow
@needs_mosquitto
def test_who_ends_while_the_bridge_is_away_is_kept(tmp_path, frigate, monkeypatch, caplog):
    monkeypatch.setattr(frigate_history, "_SETTLE_S", 0.1)
    monkeypatch.setattr(inbox_module, "_GATHER_S", 0.0)
    caplog.set_level("INFO")
    spool, now_s = Spool(tmp_path / "bridge.sqlite", 2**20), time.time()

    def told(word):
        return [record for record in caplog.records if record.message == word]

    with broker(tmp_path) as port, contextlib.closing(spool):
        client = Client5(port)
        with running(spool, port, frigate):
            wait_for(lambda: told("frigate_asked"), every_s=0.02)
            publish_end(client, frigate, "before", now_s - 30.0)
            wait_for(lambda: spool.waiting == 1, every_s=0.02)
        for n in range(3):
            publish_end(client, frigate, f"away{n}", now_s - 20.0 + n)
        with running(spool, port, frigate):
            wait_for(lambda: len(told("frigate_asked")) == 2, every_s=0.02)
            publish_end(client, frigate, "after", now_s - 10.0)
            found = set()
            wait_for(lambda: found.update(kept_ids(spool)) or "after" in found, every_s=0.02)
        client.close()
    assert found == {"before", "away0", "away1", "away2", "after"}
    assert [record.kept for record in told("frigate_asked")] == [0, 4]


def kept_ids(spool):
    return [each["id"] for each in kept(spool)]


def publish_end(client, frigate, name, start_s):
    frigate.events.append(stored_event(name, start_s))
    client.publish(
        "frigate/events", frigate_event("end", name, "corner", path_from(start_s)), qos=0
    )
