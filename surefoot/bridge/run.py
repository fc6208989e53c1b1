"""The bridge: a broker and a service, and what runs between them until it is told to stop."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

from surefoot.bridge.broker import Address, Broker
from surefoot.bridge.feeds import Topics
from surefoot.bridge.frigate_history import History
from surefoot.bridge.inward import Inward
from surefoot.bridge.outward import Outward
from surefoot.bridge.posting import Posting
from surefoot.bridge.service import Service
from surefoot.bridge.spool import Spool


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
        availability = f"{prefix}/bridge/availability"
        history = History(spool=self.spool, camera_of=self.topics.camera_of)
        broker = Broker(self.address, self.topics.asked_for, availability, history.note_connection)
        outward = Outward(
            say=broker.say,
            prefix=prefix,
            availability=availability,
            discovery=self.discovery,
            version=self.version,
        )
        inward = Inward(
            inbox=broker.inbox, topics=self.topics, spool=self.spool, whole=history.whole
        )
        failures: list[Exception] = []

        def part(work: Callable[[Service], None]) -> None:
            # One that fails must not leave the others as if all were well.
            try:
                work(Service(self.url, self.token))
            except Exception as error:
                failures.append(error)
            finally:
                stopping.set()

        works: list[Callable[[Service], None]] = [
            lambda _: inward.carry(stopping),
            lambda service: Posting(spool=self.spool, service=service).run(stopping),
            lambda service: outward.tell(service, stopping),
            lambda service: outward.listen(service, stopping),
        ]
        if (url := self.frigate_url) is not None:
            works.append(lambda _: history.run(url, stopping))
        broker.start()
        for work in works:
            threading.Thread(target=part, args=(work,), daemon=True).start()
        stopping.wait()
        broker.stop()
        if failures:
            raise failures[0]
