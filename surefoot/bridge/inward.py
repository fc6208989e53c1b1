"""Tracks from topics to the spool: a message is acknowledged once what it holds is on the disk."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import msgspec

from surefoot.bridge.assembler import Assembler, StateError
from surefoot.bridge.feeds import Body, Topics
from surefoot.bridge.inbox import Inbox, Message
from surefoot.bridge.spool import Part, Spool
from surefoot.bridge.values import Detection, Ended, MessageError, WholeTrack

log = logging.getLogger("surefoot.bridge")

_WAIT_S = 0.5
_TELL_S = 60.0
_MOST_TOPICS = 10_000
_Given = dict[str, list[Detection | Ended]]  # by source
_given = msgspec.msgpack.Decoder(_Given)
_states = msgspec.msgpack.Decoder(dict[str, bytes])


@dataclass(kw_only=True)
class Inward:
    """The assemblers of the sources, and the spool that outlives them."""

    inbox: Inbox
    topics: Topics
    spool: Spool
    whole: Callable[[], bool] = lambda: True  # nobody who ended before is missing
    _assemblers: dict[str, Assembler] = field(default_factory=dict)
    _told_s: float = -_TELL_S
    _refused_s: dict[tuple[str, str], float] = field(default_factory=dict)

    def carry(self, stopping: threading.Event) -> None:
        """Keep what comes until the event is set.

        Raises:
            StateError: the spool is of another release, or broken.
        """
        self._begin(time.time())
        while not stopping.is_set():
            if self.spool.full:
                self._tell_full()
                stopping.wait(_WAIT_S)
                continue
            messages = self.inbox.take(_WAIT_S)
            self._step([each for each in messages if self.inbox.counts(each)], time.time())

    def _begin(self, now_s: float) -> None:
        """Make the assemblers what they were; what finishes meanwhile is in the spool already."""
        try:
            for source, state in _states.decode(self.spool.state() or b"\x80").items():
                self._assembler(source).restore(state)
            for at_s, found in self.spool.given():
                self._give(_given.decode(found), at_s)
                self._finished()
        except msgspec.MsgspecError as error:
            raise StateError(f"no spool of a bridge: {error}") from error
        for assembler in self._assemblers.values():
            assembler.hear_all(now_s)
        self.spool.keep(now_s, None, [], self._state())

    def _step(self, messages: list[Message], now_s: float) -> None:
        given: _Given = {}
        parts: list[Part] = []
        marks: dict[str, float] = {}
        for message in messages:
            try:
                read = self.topics.read(message.topic, message.payload)
            except MessageError as error:
                self._tell_refused(message.topic, error)
                continue
            if isinstance(read, Body):
                parts.append(Part(read.camera, b"", read.content))
                continue
            source, found = read
            for each in found:
                if isinstance(each, WholeTrack):
                    parts.append(_part(each, source))
                    last_s = each.rows[-each.columns]
                    marks[source] = min(max(marks.get(source, last_s), last_s), now_s)
                else:
                    given.setdefault(source, []).append(each)
        self._give(given, now_s)
        finished = self._finished()
        # A silence that ended tracks is to end them in a restart, too, though nothing came.
        if given or finished or parts:
            state = self._state() if self.spool.wants_state else None
            came = msgspec.msgpack.encode(given)
            ends = marks if self.whole() else {}
            self.spool.keep(now_s, came, parts + finished, state, ends)
        self.inbox.settle(messages)

    def _give(self, given: _Given, now_s: float) -> None:
        for assembler in self._assemblers.values():
            assembler.tick(now_s)
        for source, found in given.items():
            assembler = self._assembler(source)
            for each in found:
                assembler.add(each, now_s)

    def _finished(self) -> list[Part]:
        return [
            _part(track, source)
            for source, assembler in self._assemblers.items()
            for track in assembler.take()
        ]

    def _assembler(self, source: str) -> Assembler:
        return self._assemblers.setdefault(source, Assembler())

    def _state(self) -> bytes:
        return msgspec.msgpack.encode({name: one.state() for name, one in self._assemblers.items()})

    def _tell_refused(self, topic: str, error: MessageError) -> None:
        """Log a refusal, once a minute of a topic and code: profiles are wrong in each frame."""
        now_s = time.monotonic()
        if now_s - self._refused_s.get((topic, error.code), -_TELL_S) < _TELL_S:
            return
        if len(self._refused_s) >= _MOST_TOPICS:  # wildcards match whatever others think of
            self._refused_s.clear()
        self._refused_s[topic, error.code] = now_s
        extra = {"topic": topic, "code": error.code, "detail": error.detail}
        log.warning("mqtt_message_refused", extra=extra)

    def _tell_full(self) -> None:
        if time.monotonic() - self._told_s >= _TELL_S:
            self._told_s = time.monotonic()
            log.error("bridge_full", extra={"waiting": self.spool.waiting})


def _part(track: WholeTrack, source: str) -> Part:
    return Part(track.camera, track.head(source), track.to_json())
