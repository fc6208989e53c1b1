"""Acknowledgements: in order, once, and never by another connection than the message's."""

import pytest

from surefoot.bridge import inbox as module
from surefoot.bridge.inbox import Inbox


@pytest.fixture
def acknowledged(monkeypatch):
    monkeypatch.setattr(module, "_GATHER_S", 0.0)
    return []


@pytest.fixture
def inbox(acknowledged):
    made = Inbox(acknowledged.append)
    made.begin()
    return made


def test_acknowledged_in_the_order_of_arrival(inbox, acknowledged):
    for mid in (1, 2, 3):
        inbox.add("t", b"", mid, 1)
    first, second, third = inbox.take(0.0)
    inbox.settle([second, third])
    assert acknowledged == []
    inbox.settle([first])
    assert acknowledged == [1, 2, 3]


def test_what_came_by_another_connection_is_not_acknowledged(inbox, acknowledged):
    """Its packet id may be another message's by now, which would be lost."""
    inbox.add("t", b"old", 1, 1)
    inbox.add("t", b"unread", 2, 1)
    (old, _) = inbox.take(0.0)
    inbox.add("t", b"never read", 3, 1)
    inbox.begin()
    inbox.add("t", b"new", 1, 1)
    assert not inbox.counts(old)
    inbox.settle([old])
    assert acknowledged == []
    (new,) = inbox.take(0.0)
    assert new.payload == b"new"
    inbox.settle([new])
    assert acknowledged == [1]


def test_messages_of_qos_0_outlast_a_connection_within_their_bytes(
    inbox, acknowledged, monkeypatch
):
    monkeypatch.setattr(module, "MAX_UNASKED_BYTES", 10)
    for _ in range(3):
        inbox.add("t", b"12345", 0, 0)
    inbox.begin()
    taken = inbox.take(0.0)
    assert len(taken) == 2
    assert all(inbox.counts(each) for each in taken)
    inbox.settle(taken)
    inbox.add("t", b"1234567890", 0, 0)
    assert len(inbox.take(0.0)) == 1
    assert acknowledged == []
