"""The spool: whatever happens, each detection is posted once, and what fails holds up nobody."""

import json
import logging
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surefoot.bridge import inbox as inbox_module
from surefoot.bridge import posting
from surefoot.bridge import spool as spool_module
from surefoot.bridge.feeds import read_feeds
from surefoot.bridge.inbox import Inbox
from surefoot.bridge.service import LaterError
from surefoot.bridge.spool import Part, Spool, SpoolError
from tests.surefoot.bridge.halves import inward, posting_of

T0 = 1_795_161_600.0
MIB = 2**20


def frame(n, ids, ended=()):
    boxes = [{"id": name, "box": [n, 0, n + 1, 9]} for name in ids]
    document = {"time_s": T0 + n, "detections": boxes, "ended": list(ended)}
    return json.dumps(document).encode()


class Bridge:
    """Its inward half over a file, a step at a time, beside a broker that remembers."""

    def __init__(self, path):
        self.path = path
        self.unacknowledged = {}
        self.start(0.0)

    def start(self, now_s):
        self.spool = Spool(self.path, MIB)
        self.inbox = Inbox(self.unacknowledged.pop)
        self.inward = inward(self.inbox, self.spool)
        self.inward._begin(now_s)
        for number, message in self.unacknowledged.items():  # sent again
            self.inbox.add("surefoot/yard/frames", message, number, 1)

    def publish(self, number, message):
        self.unacknowledged[number] = message
        self.inbox.add("surefoot/yard/frames", message, number, 1)

    def step(self, now_s):
        self.inward._step(self.inbox.take(0.0), now_s)

    def posted(self):
        while (group := self.spool.next((), ())) is not None:
            yield from map(json.loads, group.tracks.values())
            self.spool.drop(group)


@pytest.fixture(autouse=True)
def _no_gathering(monkeypatch):
    monkeypatch.setattr(inbox_module, "_GATHER_S", 0.0)
    monkeypatch.setattr(spool_module, "_SAVE_FROM_BYTES", 300)


@settings(max_examples=60, deadline=None)
@given(
    happens=st.lists(
        st.sampled_from(("come", "come", "come", "end", "step", "quiet", "crash")), max_size=40
    )
)
def test_whatever_crashes_when_each_detection_is_posted_once(tmp_path_factory, happens):
    bridge = Bridge(tmp_path_factory.mktemp("spool") / "bridge.sqlite")
    now_s, sent = 0.0, set()
    for n, what in enumerate(happens):
        now_s += 1.0
        if what == "come":
            ids = ["a", "b"] if n % 3 else ["b"]
            bridge.publish(n, frame(n, ids))
            sent |= {(name, T0 + n) for name in ids}
        elif what == "end":
            bridge.publish(n, frame(n, [], ["a"]))
        elif what == "step":
            bridge.step(now_s)
            assert not bridge.unacknowledged
        elif what == "quiet":
            bridge.step(now_s := now_s + 6.0)
        else:
            bridge.spool.close()
            bridge.start(now_s)
    bridge.step(now_s)
    bridge.step(now_s + 60.0)
    points = [(each["id"], row[0]) for each in bridge.posted() for row in each["boxes"]]
    bridge.spool.close()
    assert sorted(points) == sorted(sent)


def test_a_second_bridge_on_the_same_file_is_told(tmp_path):
    first = Spool(tmp_path / "bridge.sqlite", MIB)
    with pytest.raises(SpoolError, match="each bridge needs a file of its own"):
        Spool(tmp_path / "bridge.sqlite", MIB)
    first.close()


def test_a_full_spool_acknowledges_nothing_and_says_so(tmp_path, caplog):
    spool = Spool(tmp_path / "bridge.sqlite", 10)
    spool.keep(0.0, None, [Part("yard", b"", b"x" * 20)])
    inbox, stopping = Inbox(pytest.fail), threading.Event()
    inbox.add("surefoot/yard/tracks", b"{}", 1, 1)
    threading.Timer(0.7, stopping.set).start()
    with caplog.at_level(logging.ERROR):
        inward(inbox, spool).carry(stopping)
    assert [record.message for record in caplog.records] == ["bridge_full"]
    spool.close()


class Tripping:
    """A service that answers 500 to bodies with a word in them, as long as it trips."""

    def __init__(self, word):
        self.word, self.trips, self.stored, self.posts = word, True, [], 0

    def post_tracks(self, camera_id, body):
        self.posts += 1
        if self.trips and self.word in body:
            raise LaterError("500 internal", away=False)
        tracks = json.loads(body)["tracks"]
        self.stored += [(camera_id, each["id"]) for each in tracks]
        return {"accepted": len(tracks), "rejected": []}


def test_a_track_that_the_service_trips_over_waits_alone_and_is_not_lost(
    tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(posting, "_FIRST_S", 0.01)
    spool, service = Spool(tmp_path / "bridge.sqlite", MIB), Tripping(b"bad")
    head = b'{"source":"x"}'
    for name in [*(f"good{n}" for n in range(1000)), "bad"]:
        part = Part(f"cam{len(name) % 2}", head, json.dumps({"id": name}).encode())
        spool.keep(0.0, None, [part])
    stopping, post = threading.Event(), posting_of(spool, service)
    monkeypatch.setattr(spool, "wait", lambda _: stopping.wait(0.01))
    thread = threading.Thread(target=post.run, args=(stopping,))
    thread.start()
    wait(lambda: len(service.stored) == 1000)
    assert spool.waiting == 1
    assert "tracks_wait" in caplog.text
    service.trips = False
    wait(lambda: spool.waiting == 0)
    stopping.set()
    thread.join()
    assert len(service.stored) == len(set(service.stored)) == 1001
    spool.close()


def test_a_service_that_trips_over_everything_is_left_alone_longer_and_longer(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(posting, "MOST_HELD", 3)
    spool, service = Spool(tmp_path / "bridge.sqlite", MIB), Tripping(b"")
    for n in range(50):
        spool.keep(0.0, None, [Part("yard", b"", b"{}%d" % n)])
    post = posting_of(spool, service)
    assert post._post_all(threading.Event()) == 0.0
    assert (service.posts, spool.waiting, len(post._held)) == (4, 50, 3)
    spool.close()


def wait(what):
    event = threading.Event()
    for _ in range(1000):
        if what():
            return
        event.wait(0.02)
    raise AssertionError("never")


@pytest.mark.parametrize(
    ("setting", "needed"),
    [
        ("axis", "format:topic"),
        ("axis:", "format:topic"),
        ("onvif-other:a/+", "format:topic"),
        ("deepstream-0x5:a", "format:topic"),
        ("axis:a/b", "a camera"),
    ],
)
def test_feeds_that_are_none_are_told(setting, needed):
    with pytest.raises(ValueError, match=needed):
        read_feeds(setting)
