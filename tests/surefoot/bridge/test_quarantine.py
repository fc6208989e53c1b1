"""No message ends the bridge for good: a reader's fault costs one message, a crash three tries."""

import json
import logging

import pytest

from surefoot.bridge import frames
from surefoot.bridge import inbox as inbox_module
from surefoot.bridge.inbox import Inbox
from surefoot.bridge.quarantine import MOST_CRASHES, Quarantine
from surefoot.bridge.spool import Spool
from surefoot.bridge.tally import Tally
from tests.surefoot.bridge.halves import inward
from tests.surefoot.bridge.test_adapters import NESTED
from tests.surefoot.bridge.test_crashes import MIB, frame

GOOD, KILLER = frame(1, ["a"]), b'{"time_s": 1, "kills": true}'


class KilledError(BaseException):
    """The end of the process, as far as a test can have one."""


@pytest.fixture(autouse=True)
def _no_gathering(monkeypatch):
    monkeypatch.setattr(inbox_module, "_GATHER_S", 0.0)


@pytest.fixture
def spool(tmp_path):
    made = Spool(tmp_path / "bridge.sqlite", MIB)
    yield made
    made.close()


def published(acknowledged, messages):
    inbox = Inbox(acknowledged.append)
    for number, message in enumerate(messages):
        inbox.add("surefoot/yard/frames", message, number, 1)
    return inbox


@pytest.mark.parametrize(
    ("topic", "message"),
    [("frigate/events", NESTED), ("surefoot/yard/frames", NESTED), ("surefoot/yard/frames", b"x")],
)
def test_message_that_cannot_be_read_is_rejected_and_the_next_is_kept(spool, topic, message):
    acknowledged, tally = [], Tally()
    inbox = published(acknowledged, [])
    inbox.add(topic, message, 1, 1)
    inbox.add("surefoot/yard/frames", GOOD, 2, 1)
    reading = inward(inbox, spool, tally=tally)
    reading._step(inbox.take(0.0), 10.0)
    reading._step([], 20.0)
    assert acknowledged == [1, 2]
    assert spool.waiting == 1
    assert tally.report()["counts"]["messages_rejected"] == 1


def test_exception_of_a_reader_rejects_the_message_with_an_extract(spool, monkeypatch, caplog):
    def broken(_):
        raise ZeroDivisionError("of a reader")

    monkeypatch.setattr(frames, "parsed_json", broken)
    acknowledged, tally = [], Tally()
    inbox = published(acknowledged, [b"\xff" + b"x" * 500])
    with caplog.at_level(logging.WARNING):
        inward(inbox, spool, tally=tally)._step(inbox.take(0.0), 10.0)
    assert acknowledged == [0]
    (rejected,) = tally.report()["newest_rejections"]
    assert (rejected["code"], rejected["topic"]) == ("reader_failed", "surefoot/yard/frames")
    assert rejected["detail"] == "ZeroDivisionError: of a reader"
    assert rejected["extract"] == "\\xff" + "x" * 119
    assert [each.message for each in caplog.records] == ["messages_rejected"]


def test_bad_rows_are_counted_and_the_others_kept(spool):
    tally = Tally()
    document = json.loads(frame(1, ["a", "b", "c"]))
    document["detections"][0]["id"] = document["detections"][1]["box"] = None
    inbox = published([], [json.dumps(document).encode()])
    reading = inward(inbox, spool, tally=tally)
    reading._step(inbox.take(0.0), 10.0)
    reading._step([], 20.0)
    assert [json.loads(each)["id"] for each in spool.next((), ()).tracks.values()] == ["c"]
    assert tally.report()["counts"] == {"messages": 1, "rows_skipped": 2}


def run_until_killed(path, messages, tally):
    """One life of the process: the ids of messages that are acknowledged before it is killed."""
    spool, acknowledged = Spool(path, MIB), []
    inbox = published(acknowledged, messages)

    def handle(some):
        if any(b"kills" in each.payload for each in some):
            raise KilledError
        inbox.settle(some)

    quarantine = Quarantine(spool, tally)
    try:
        inbox.settle(quarantine.handle(inbox.take(0.0), handle))
    except KilledError:
        return None
    finally:
        spool.close()
    return acknowledged


def test_message_that_kills_the_process_is_set_aside_and_no_other_is(tmp_path):
    path, tally = tmp_path / "bridge.sqlite", Tally()
    others = [frame(n, ["a"]) for n in range(2, 6)]
    messages = [*others[:2], KILLER, *others[2:]]
    # Once with all of its step, and then alone.
    for _ in range(1 + MOST_CRASHES):
        assert run_until_killed(path, messages, tally) is None
    assert "messages_set_aside" not in tally.report()["counts"]
    assert run_until_killed(path, messages, tally) == [0, 1, 2, 3, 4]
    assert tally.report()["counts"]["messages_set_aside"] == 1
    # It is retained, say, and comes with each subscription: it is not read again.
    assert run_until_killed(path, messages, tally) == [0, 1, 2, 3, 4]
    spool = Spool(path, MIB)
    with spool.transaction(durable=True) as db:
        assert db.execute("SELECT topic, payload FROM set_aside").fetchall() == [
            ("surefoot/yard/frames", KILLER)
        ]
        assert db.execute("SELECT count(*) FROM suspects").fetchone() == (0,)
    spool.close()


def test_process_killed_for_another_reason_costs_no_message(tmp_path):
    path, tally = tmp_path / "bridge.sqlite", Tally()
    for _ in range(MOST_CRASHES - 1):
        assert run_until_killed(path, [KILLER], tally) is None
    harmless = KILLER.replace(b"kills", b"x")
    assert run_until_killed(path, [harmless], tally) == [0]
    assert tally.report()["counts"] == {}
