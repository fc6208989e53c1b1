"""Messages that were being handled when the process ended: after three times they are set aside.

What is handled is noted on disk first, so that a crash in native code and a kill count, too. After
a crash the messages of that step are handled one by one, which shows which of them it is.
"""

import hashlib
import logging
import time
from collections.abc import Callable, Sequence

from surefoot.bridge.inbox import Message
from surefoot.bridge.spool import Spool
from surefoot.bridge.tally import EXTRACT_BYTES, Tally

log = logging.getLogger("surefoot.bridge")

MOST_CRASHES = 3
_MOST_SUSPECTS = 2_000
_MOST_ASIDE = 100
_ASIDE_BYTES = 64 * 1024  # of a message that is set aside, for a person to look at


class Quarantine:
    """Suspects among the messages, kept in the spool; for the thread that handles messages."""

    def __init__(self, spool: Spool, tally: Tally) -> None:
        self._spool, self._tally = spool, tally
        with spool.transaction(durable=True) as db:
            last = [digest for (digest,) in db.execute("SELECT digest FROM under_way")]
            # Of several any may be it: each has to come alone before it is blamed.
            crashes = 1 if len(last) == 1 else 0
            db.executemany(
                "INSERT INTO suspects VALUES (?, ?, ?) ON CONFLICT (digest) DO UPDATE "
                "SET crashes = crashes + excluded.crashes, at_s = excluded.at_s",
                [(digest, crashes, time.time()) for digest in last],
            )
            db.execute("DELETE FROM under_way")
            db.execute(
                "DELETE FROM suspects WHERE digest NOT IN "
                "(SELECT digest FROM suspects ORDER BY at_s DESC LIMIT ?)",
                (_MOST_SUSPECTS,),
            )
            self._crashes = dict(db.execute("SELECT digest, crashes FROM suspects").fetchall())
            self._aside = {digest for (digest,) in db.execute("SELECT digest FROM set_aside")}
        if last:
            log.warning("messages_suspected", extra={"messages": len(last)})

    def handle(
        self, messages: Sequence[Message], handle: Callable[[list[Message]], None]
    ) -> list[Message]:
        """Handle messages, suspects one by one; return those that are set aside, unread."""
        usual: list[Message] = []
        aside: list[Message] = []
        for message in messages:
            digest = _digest(message)
            if digest in self._aside:
                aside.append(message)
            elif digest not in self._crashes:
                usual.append(message)
            else:
                self._noted(usual, handle)
                usual = []
                if self._crashes[digest] >= MOST_CRASHES:
                    self._set_aside(message, digest)
                    aside.append(message)
                else:
                    self._noted([message], handle)
                    self._clear(digest)
        self._noted(usual, handle)
        return aside

    def _noted(self, messages: list[Message], handle: Callable[[list[Message]], None]) -> None:
        if not messages:
            return
        with self._spool.transaction(durable=False) as db:
            db.executemany(
                "INSERT OR IGNORE INTO under_way VALUES (?)",
                [(_digest(each),) for each in messages],
            )
        handle(messages)
        with self._spool.transaction(durable=False) as db:
            db.execute("DELETE FROM under_way")

    def _clear(self, digest: bytes) -> None:
        del self._crashes[digest]
        with self._spool.transaction(durable=False) as db:
            db.execute("DELETE FROM suspects WHERE digest = ?", (digest,))

    def _set_aside(self, message: Message, digest: bytes) -> None:
        crashes = self._crashes.pop(digest)
        with self._spool.transaction(durable=True) as db:
            db.execute("DELETE FROM suspects WHERE digest = ?", (digest,))
            db.execute(
                "REPLACE INTO set_aside VALUES (?, ?, ?, ?)",
                (digest, time.time(), message.topic, message.payload[:_ASIDE_BYTES]),
            )
            db.execute(
                "DELETE FROM set_aside WHERE digest NOT IN "
                "(SELECT digest FROM set_aside ORDER BY at_s DESC LIMIT ?)",
                (_MOST_ASIDE,),
            )
            self._aside = {digest for (digest,) in db.execute("SELECT digest FROM set_aside")}
        self._tally.set_aside(message.topic, crashes, message.payload[:EXTRACT_BYTES])


def _digest(message: Message) -> bytes:
    what = message.topic.encode("utf-8", "surrogatepass") + b"\0"
    return hashlib.blake2b(what + message.payload, digest_size=16).digest()
