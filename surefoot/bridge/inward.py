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
from surefoot.bridge.quarantine import Quarantine
from surefoot.bridge.spool import Part, Spool
from surefoot.bridge.tally import Tally
from surefoot.bridge.values import (
    MAX_DETAIL,
    Detection,
    Ended,
    Found,
    MessageError,
    SkippedRow,
    WholeTrack,
)

log = logging.getLogger("surefoot.bridge")

_WAIT_S = 0.5
_LOG_S = 60.0
_Given = dict[str, list[Detection | Ended]]  # by source
_given = msgspec.msgpack.Decoder(_Given)
_states = msgspec.msgpack.Decoder(dict[str, bytes])


@dataclass(kw_only=True)
class Inward:
    """The assemblers of the sources, and the spool that outlives them.

    `admits` returns whether the service has a camera, `step_since_s` is when the step under way
    began, by the monotonic clock.
    """

    inbox: Inbox
    topics: Topics
    spool: Spool
    tally: Tally
    admits: Callable[[str], bool]
    whole: Callable[[], bool] = lambda: True  # nobody who ended before is missing
    step_since_s: float | None = None
    _assemblers: dict[str, Assembler] = field(default_factory=dict)
    _logged_s: float = -_LOG_S

    def carry(self, stopping: threading.Event) -> None:
        """Keep what comes until the event is set."""
        self._begin(time.time())
        quarantine = Quarantine(self.spool, self.tally)
        while not stopping.is_set():
            if self.spool.full:
                self._log_full()
                stopping.wait(_WAIT_S)
                continue
            messages = [each for each in self.inbox.take(_WAIT_S) if self.inbox.counts(each)]
            self.step_since_s = time.monotonic()
            if not messages:
                self._step([])
            self.inbox.settle(quarantine.handle(messages, self._step))
            self.step_since_s = None

    def _begin(self, now_s: float) -> None:
        """Restore the assemblers; tracks that finish meanwhile are in the spool already.

        A state that cannot be read is dropped, with the tracks that were open: the spool's other
        tables are sound.
        """
        try:
            for source, state in _states.decode(self.spool.state() or b"\x80").items():
                self._assembler(source).restore(state)
            for at_s, found in self.spool.given():
                self._give(_given.decode(found), at_s)
                self._finished()
        except (msgspec.MsgspecError, StateError) as error:
            log.error("open_tracks_dropped", extra={"reason": str(error)})
            self._assemblers.clear()
        for assembler in self._assemblers.values():
            assembler.hear_all(now_s)
        self.spool.keep(now_s, None, [], self._state())

    def _step(self, messages: list[Message], now_s: float | None = None) -> None:
        now_s = time.time() if now_s is None else now_s
        given: _Given = {}
        parts: list[Part] = []
        marks: dict[str, float] = {}
        for message in messages:
            read = self._read(message)
            parts += read.parts
            for source, found in read.given.items():
                given.setdefault(source, []).extend(found)
            for source, last_s in read.ends.items():
                marks[source] = min(max(marks.get(source, last_s), last_s), now_s)
        self._give(given, now_s)
        finished = self._finished()
        # A silence that ended tracks is to end them in a restart, too, though nothing came.
        if given or finished or parts:
            state = self._state() if self.spool.wants_state else None
            came = msgspec.msgpack.encode(given)
            ends = marks if self.whole() else {}
            self.spool.keep(now_s, came, parts + finished, state, ends)
        self.inbox.settle(messages)

    def _read(self, message: Message) -> "_Read":
        """What a message holds; nothing if it is rejected, or its camera is unknown."""
        self.tally.count("messages")
        read = _Read()
        try:
            found = self.topics.read(message.topic, message.payload)
            if isinstance(found, Body):
                read.parts.append(Part(found.camera, b"", found.content))
            else:
                self._sort(read, *found)
            cameras = read.cameras
        except MessageError as error:
            self.tally.reject(message.topic, error.code, error.detail, message.payload)
            return _Read()
        except Exception as error:  # a reader's fault costs one message, and never the bridge
            detail = f"{type(error).__name__}: {error}"[:MAX_DETAIL]
            self.tally.reject(message.topic, "reader_failed", detail, message.payload)
            return _Read()
        for camera in cameras:
            if not self.admits(camera):
                self.tally.unknown(camera, message.topic)
                read.drop(camera)
        if read.skipped:
            self.tally.skip(message.topic, read.skipped, message.payload)
        return read

    def _sort(self, read: "_Read", source: str, found: list[Found]) -> None:
        for each in found:
            if isinstance(each, SkippedRow):
                read.skipped.append(each)
            elif isinstance(each, WholeTrack):
                read.parts.append(_part(each, source))
                last_s = each.rows[-each.columns]
                read.ends[source] = max(read.ends.get(source, last_s), last_s)
            else:
                read.given.setdefault(source, []).append(each)

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

    def _log_full(self) -> None:
        if time.monotonic() - self._logged_s >= _LOG_S:
            self._logged_s = time.monotonic()
            log.error("bridge_full", extra={"waiting": self.spool.waiting})


@dataclass(slots=True)
class _Read:
    """What one message holds, by source; `ends` are the last times of whole tracks."""

    parts: list[Part] = field(default_factory=list)
    given: _Given = field(default_factory=dict)
    ends: dict[str, float] = field(default_factory=dict)
    skipped: list[SkippedRow] = field(default_factory=list)

    @property
    def cameras(self) -> set[str]:
        found = {each.camera for some in self.given.values() for each in some}
        return found | {part.camera for part in self.parts}

    def drop(self, camera: str) -> None:
        """Remove what is of one camera."""
        self.parts = [part for part in self.parts if part.camera != camera]
        others = {
            source: [each for each in found if each.camera != camera]
            for source, found in self.given.items()
        }
        self.given = {source: found for source, found in others.items() if found}


def _part(track: WholeTrack, source: str) -> Part:
    return Part(track.camera, track.head(source), track.to_json())
