"""Messages for cameras that the service does not have are dropped, and delay no others."""

import json
import logging

import pytest

from surefoot.bridge import inbox as inbox_module
from surefoot.bridge.door import LIFETIME_S, Door
from surefoot.bridge.inbox import Inbox
from surefoot.bridge.service import LaterError, RefusedError
from surefoot.bridge.spool import Part, Spool
from surefoot.bridge.tally import Tally
from tests.surefoot.bridge.halves import Listing, inward, posting_of

HEAD = b'{"source":"x"}'


@pytest.fixture
def spool(tmp_path):
    made = Spool(tmp_path / "bridge.sqlite", 64 * 2**20)
    yield made
    made.close()


class Clock:
    now_s = 100.0

    def __call__(self):
        return self.now_s


def test_door_asks_once_for_many_unknown_names_and_again_after_its_lifetime():
    listing, clock = Listing("yard"), Clock()
    door = Door(listing, clock)
    assert [door.admits(f"unknown-{n}") for n in range(100)] == [False] * 100
    assert door.admits("yard")
    assert listing.asked == 1
    listing.cameras = ("yard", "gate")
    assert not door.admits("gate")
    clock.now_s += LIFETIME_S
    assert door.admits("gate")
    assert listing.asked == 2


def test_door_asks_again_after_an_event_about_a_camera_that_is_new():
    listing, clock = Listing("yard"), Clock()
    door = Door(listing, clock)
    assert not door.admits("gate")
    listing.cameras = ("yard", "gate")
    door.expect("yard")
    assert not door.admits("gate")
    door.expect("gate")
    assert door.admits("gate")


def test_door_admits_every_camera_while_the_service_does_not_answer():
    class Away:
        def items(self, path):
            raise LaterError("503", away=True)

    door = Door(Away(), Clock())
    assert door.admits("yard")
    assert door.cameras() is None


def test_messages_of_unknown_cameras_are_counted_by_name_and_not_kept(spool, monkeypatch, caplog):
    monkeypatch.setattr(inbox_module, "_GATHER_S", 0.0)
    acknowledged, tally = [], Tally()
    inbox = Inbox(acknowledged.append)
    for n in range(300):
        inbox.add(f"surefoot/unknown-{n % 60}/tracks", b"{}", n, 1)
    inbox.add("surefoot/yard/tracks", b"{}", 300, 1)
    reading = inward(inbox, spool, tally=tally, admits=Door(Listing("yard")).admits)
    with caplog.at_level(logging.WARNING):
        reading._step(inbox.take(0.0), 10.0)
    assert acknowledged == list(range(301))
    assert spool.next((), ()).camera == "yard"
    assert spool.waiting == 1
    report = tally.report()
    assert report["counts"] == {"messages": 301, "messages_unknown_camera": 300}
    assert len(report["unknown_cameras"]) == 51
    assert (report["unknown_cameras"]["unknown-7"], report["unknown_cameras"]["others"]) == (5, 50)
    assert len(caplog.records) == 51


class Knowing:
    """A service that has some cameras, and answers 404 for all others."""

    def __init__(self, *cameras):
        self.cameras, self.posts = cameras, []

    def post_tracks(self, camera_id, body):
        self.posts.append(camera_id)
        if camera_id not in self.cameras:
            raise RefusedError(404, "not_found", "there is no such camera")
        return {"accepted": len(json.loads(body)["tracks"]), "rejected": []}


def test_tracks_of_unknown_cameras_that_were_kept_are_dropped_at_once(spool):
    """They came while the service was away: one post each delayed a good track by 138 s."""
    others = [Part(f"unknown-{n}", b"", b'{"tracks": []}') for n in range(5_000)]
    spool.keep(0.0, None, [*others, Part("yard", HEAD, b'{"id": "1"}')])
    service, tally = Knowing("yard"), Tally()
    posting = posting_of(spool, service, door=Door(Listing("yard")), tally=tally)
    assert posting._post_all(_Never()) is None
    assert service.posts == ["unknown-0", "yard"]
    assert spool.waiting == 0
    counts = tally.report()["counts"]
    assert (counts["tracks_rejected"], counts["tracks_posted"]) == (5_000, 1)


def test_cameras_take_turns_however_much_one_of_them_has(spool):
    flood = [Part("busy", b"", b'{"tracks": []}') for _ in range(1_000)]
    heads = [Part("heads", b'{"size":[%d,1]}' % n, b'{"id": "1"}') for n in range(1_000)]
    good = [Part("yard", HEAD, b'{"id": "1"}'), Part("zoo", HEAD, b'{"id": "1"}')]
    spool.keep(0.0, None, [*flood, *heads, *good])
    cameras = []
    for _ in range(6):
        group = spool.next((), ())
        cameras.append(group.camera)
        spool.drop(group)
    assert cameras == ["busy", "heads", "yard", "zoo", "busy", "heads"]


def test_tracks_of_one_camera_keep_their_order_and_held_ones_their_place(spool):
    spool.keep(0.0, None, [Part("yard", HEAD, b'{"id":"%d"}' % n) for n in range(5)])
    spool.keep(0.0, None, [Part("yard", b"", b"{}")])
    assert list(spool.next((2,), (4,)).tracks) == [1, 3, 5]
    assert list(spool.next((1, 2, 3, 5), (4,)).tracks) == [4]
    assert list(spool.next((1, 2, 3, 4, 5), ()).tracks) == [6]
    assert spool.next(range(7), ()) is None


class _Never:
    def is_set(self):
        return False
