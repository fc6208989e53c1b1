"""States out: what the topics say is what the API says, whatever events were missed."""

import threading

from surefoot.bridge import outward as module
from surefoot.bridge.outward import Outward
from surefoot.bridge.service import LaterError
from tests.running import wait_for


class Service:
    """A service whose camera changes while no stream is open, and tells no event of it."""

    def __init__(self):
        self.state = "learning"
        self.drop = threading.Event()

    def items(self, path, **_):
        return [{"id": "yard", "name": ""}] if path == "/cameras" else []

    def get(self, path):
        return {"state": self.state}

    def events(self, after):
        yield None
        self.drop.wait(20)
        self.drop.clear()
        raise LaterError("the stream has ended", away=True)


def test_a_stream_that_begins_anew_asks_for_all(monkeypatch):
    for name in ("_GATHER_S", "_FIRST_S"):
        monkeypatch.setattr(module, name, 0.02)
    said, service, stopping = {}, Service(), threading.Event()
    outward = Outward(
        say=said.__setitem__, prefix="surefoot", availability="there", discovery=None, version="1"
    )
    threads = [
        threading.Thread(target=work, args=(service, stopping))
        for work in (outward.listen, outward.tell)
    ]
    for thread in threads:
        thread.start()
    wait_for(lambda: "learning" in said.get("surefoot/yard/state", ""), every_s=0.01)
    service.state = "drifting"
    service.drop.set()
    wait_for(lambda: "drifting" in said["surefoot/yard/state"], timeout_s=10, every_s=0.01)
    stopping.set()
    service.drop.set()
    for thread in threads:
        thread.join(5)
