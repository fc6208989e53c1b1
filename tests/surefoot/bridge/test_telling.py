"""What goes on for long is told once a minute: a log with a line for each attempt is not read."""

import threading

from surefoot.bridge.backlog import Backlog
from surefoot.bridge.feeds import Topics
from surefoot.bridge.inbox import Inbox
from surefoot.bridge.service import LaterError
from surefoot.bridge.spool import Part, Spool
from tests.surefoot.bridge.halves import inward, posting_of


def test_what_waits_is_told_once_a_minute_and_that_it_ended(caplog):
    caplog.set_level("INFO")
    backlog = Backlog()
    for now_s in range(0, 130, 10):
        backlog.tell(float(now_s), waiting=now_s)
    assert [(each.waiting, each.since) for each in caplog.records] == [
        (waiting, "1970-01-01T00:00:00+00:00") for waiting in (0, 60, 120)
    ]
    backlog.end(130.0)
    backlog.end(131.0)
    assert [each.message for each in caplog.records[3:]] == ["tracks_taken_again"]


class Broken:
    """A service that fails on every body."""

    def post_tracks(self, camera_id, body):
        raise LaterError(f"500 internal {camera_id}", away=False)


def test_many_bodies_that_fail_are_one_line(tmp_path, caplog):
    spool = Spool(tmp_path / "bridge.sqlite", 2**20)
    spool.keep(0.0, None, [Part(f"cam{n}", b"", b"{}") for n in range(50)])
    posting_of(spool, Broken())._post_all(threading.Event())
    (told,) = (each for each in caplog.records if each.message == "tracks_wait")
    assert (told.camera_id, told.reason, told.waiting) == ("cam0", "500 internal cam0", 50)
    spool.close()


def test_a_message_that_is_refused_in_each_frame_is_told_once(tmp_path, caplog):
    spool, acknowledged = Spool(tmp_path / "bridge.sqlite", 2**20), []
    inbox, stopping = Inbox(acknowledged.append), threading.Event()
    for mid in range(1, 41):
        inbox.add(f"surefoot/cam{mid % 2}/frames", b"no JSON", mid, 1)
    topics = Topics(prefix="surefoot", frigate=None, cameras={})
    timer = threading.Timer(1.5, stopping.set)
    timer.start()
    inward(inbox, spool, topics=topics).carry(stopping)
    assert len(acknowledged) == 40
    told = [each.topic for each in caplog.records if each.message == "messages_rejected"]
    assert sorted(told) == ["surefoot/cam0/frames", "surefoot/cam1/frames"]
    spool.close()


def test_no_post_is_empty_where_the_oldest_rest(tmp_path):
    spool = Spool(tmp_path / "spool", 10**8)
    spool.keep(0.0, None, [Part("yard", b'{"source":"a"}', b"%d" % n) for n in range(450)])
    first = spool.next((), ())
    assert len(first.tracks) == 200
    held = list(first.tracks)
    second = spool.next(held, held)  # the service failed on the first: all of it rests
    assert [len(second.tracks), min(second.tracks)] == [200, max(held) + 1]
    spool.drop(second)
    assert len(spool.next(held, held).tracks) == 50
    spool.drop(spool.next(held, held))
    assert spool.next(held, held) is None
