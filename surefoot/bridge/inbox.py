"""Messages of a broker between their arrival and their acknowledgement, in order."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

log = logging.getLogger("surefoot.bridge")

RECEIVE_MAXIMUM = 400  # messages that a broker sends ahead of their acknowledgement
MAX_UNASKED_BYTES = 64 * 1024 * 1024  # of QoS 0: a broker holds none of these back
_GATHER_S = 0.5  # so that what ends at about the same time is one post
_TELL_S = 60.0


@dataclass(slots=True, eq=False)
class Message:
    """One message; `session` counts the connection that it came by, None with QoS 0."""

    topic: str
    payload: bytes
    mid: int
    session: int | None
    settled: bool = False


class Inbox:
    """What has come and is not settled; `acknowledge` is called with packet ids, in their order.

    A broker sends again what was unacknowledged when the connection was lost, and may use its
    packet ids anew: what came by an earlier connection is forgotten, never acknowledged.
    """

    def __init__(self, acknowledge: Callable[[int], object]) -> None:
        self._acknowledge = acknowledge
        self._changed = threading.Condition()
        self._session = 0
        self._unread: deque[Message] = deque()
        self._unsettled: deque[Message] = deque()  # of QoS 1, in order of arrival
        self._unasked_bytes = self._dropped = 0
        self._told_s = -_TELL_S

    @property
    def dropped(self) -> int:
        """Messages of QoS 0 for which there was no room."""
        return self._dropped

    def begin(self) -> None:
        """Forget what came with QoS 1: the connection by which it could be acknowledged is over."""
        with self._changed:
            self._session += 1
            self._unsettled.clear()
            self._unread = deque(each for each in self._unread if each.session is None)

    def add(self, topic: str, payload: bytes, mid: int, qos: int) -> None:
        """Take a message in; of QoS 0 those are dropped for which there is no room."""
        with self._changed:
            if qos == 0:
                if self._unasked_bytes + len(payload) > MAX_UNASKED_BYTES:
                    self._drop()
                    return
                self._unasked_bytes += len(payload)
            message = Message(topic, payload, mid, self._session if qos else None)
            if qos:
                self._unsettled.append(message)
            self._unread.append(message)
            self._changed.notify()

    def take(self, wait_s: float) -> list[Message]:
        """What is unread, gathered for a moment from the first on; empty if none came in time."""
        with self._changed:
            if self._changed.wait_for(lambda: self._unread, wait_s):
                # A broker that waits for acknowledgements sends no more, however long we gather.
                half = RECEIVE_MAXIMUM // 2
                self._changed.wait_for(lambda: len(self._unread) >= half, _GATHER_S)
            taken = [self._unread.popleft() for _ in range(min(len(self._unread), RECEIVE_MAXIMUM))]
        return taken

    def counts(self, message: Message) -> bool:
        """True unless the broker will send it again."""
        return message.session in (None, self._session)

    def settle(self, messages: Sequence[Message]) -> None:
        """Note that these are stored, or never will be; acknowledge all up to the first other.

        MQTT wants acknowledgements in the order of the messages (5.0, 4.6).
        """
        with self._changed:
            for message in messages:
                message.settled = True
                if message.session is None:
                    self._unasked_bytes -= len(message.payload)
            while self._unsettled and self._unsettled[0].settled:
                self._acknowledge(self._unsettled.popleft().mid)

    def _drop(self) -> None:
        self._dropped += 1
        if time.monotonic() - self._told_s >= _TELL_S:
            self._told_s = time.monotonic()
            log.warning(
                "mqtt_messages_dropped",
                extra={"qos": 0, "dropped": self._dropped, "max_bytes": MAX_UNASKED_BYTES},
            )
