"""The bridge: a broker and a service, and what runs between them until it is to stop."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from surefoot.bridge.broker import Address, Broker
from surefoot.bridge.door import Door
from surefoot.bridge.feeds import Topics
from surefoot.bridge.frigate_history import History
from surefoot.bridge.heartbeat import Heartbeat, bridge_name
from surefoot.bridge.inward import Inward
from surefoot.bridge.outward import Outward
from surefoot.bridge.posting import Posting
from surefoot.bridge.service import Service
from surefoot.bridge.spool import Spool
from surefoot.bridge.tally import Tally

_DOOR_S = 5.0  # for which a message may wait for the service's list of cameras
_STOP_S = 3.0  # for which a step under way, and the last heartbeat, are waited for


@dataclass(frozen=True, kw_only=True)
class Bridge:
    """What a bridge is between; `discovery` is Home Assistant's prefix, or None for none.

    `frigate_url` is where Frigate is asked for what no broker has brought, or None for nowhere.
    """

    address: Address
    topics: Topics
    spool: Spool
    frigate_url: str | None
    url: str
    token: str | None
    discovery: str | None
    version: str

    def run(self, stopping: threading.Event) -> None:
        """Carry tracks in, states and alerts out, until the event is set.

        What is not in the spool then is not acknowledged: the broker sends it again.
        """
        prefix = self.topics.prefix
        tally, door = Tally(), Door(Service(self.url, self.token, _DOOR_S))
        availability = f"{prefix}/bridge/availability"
        history = History(spool=self.spool, camera_of=self.topics.camera_of)
        broker = Broker(self.address, self.topics.asked_for, availability, history.note_connection)
        outward = Outward(
            say=broker.say,
            prefix=prefix,
            availability=availability,
            discovery=self.discovery,
            version=self.version,
            note_camera=door.expect,
        )
        inward = Inward(
            inbox=broker.inbox,
            topics=self.topics,
            spool=self.spool,
            tally=tally,
            admits=door.admits,
            whole=history.whole,
        )

        def report() -> dict[str, Any]:
            found = tally.report()
            found["counts"]["messages_dropped"] = broker.inbox.dropped
            return found | {
                "connected": broker.connected,
                "waiting": self.spool.waiting,
                "spools_moved_aside": self.spool.moved_aside,
            }

        def step_s() -> float:
            since_s = inward.step_since_s
            return 0.0 if since_s is None else time.monotonic() - since_s

        name = bridge_name(self.address.client_id)
        heartbeat = Heartbeat(name=name, report=report, step_s=step_s)
        failures: list[Exception] = []

        def part(work: Callable[[Service], None]) -> None:
            # One that fails must not leave the others as if all were well.
            try:
                work(Service(self.url, self.token))
            except Exception as error:
                failures.append(error)
            finally:
                stopping.set()

        works: dict[str, Callable[[Service], None]] = {
            "inward": lambda _: inward.carry(stopping),
            "posting": lambda service: Posting(
                spool=self.spool, service=service, door=door, tally=tally
            ).run(stopping),
            "states": lambda service: outward.tell(service, stopping),
            "events": lambda service: outward.listen(service, stopping),
            "heartbeat": lambda service: heartbeat.run(service, stopping),
        }
        if (url := self.frigate_url) is not None:
            works["history"] = lambda _: history.run(url, stopping)
        broker.start()
        threads = {
            name: threading.Thread(target=part, args=(work,), daemon=True)
            for name, work in works.items()
        }
        for thread in threads.values():
            thread.start()
        stopping.wait()
        broker.stop()
        # A step that is cut off would look like a crash; the others may wait for answers.
        for name in ("inward", "heartbeat"):
            threads[name].join(_STOP_S)
        if failures:
            raise failures[0]
