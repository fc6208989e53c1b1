"""The bridge's sign of life: sent while it works, and its end if a message hangs."""

import threading

import pytest

from surefoot.bridge import heartbeat as module
from surefoot.bridge.heartbeat import HANGS_S, Heartbeat, bridge_name
from surefoot.bridge.service import LaterError


class Service:
    """Keeps what is put, and fails as often as a test wants."""

    def __init__(self, failures=0):
        self.put_at, self.failures = [], failures

    def put(self, path, document):
        if self.failures:
            self.failures -= 1
            raise LaterError("503", away=True)
        self.put_at.append((path, document["stopped"]))


def beating(monkeypatch, service, step_s, beats):
    """Run a heartbeat until it has been asked so often for the step; return its exit statuses."""
    monkeypatch.setattr(module, "BEAT_S", 0.0)
    stopping, ends = threading.Event(), []
    steps = iter(range(beats))

    def asked():
        if next(steps) == beats - 1:
            stopping.set()
        return step_s

    heartbeat = Heartbeat(name="b", report=dict, step_s=asked, end=ends.append)
    heartbeat.run(service, stopping)
    return ends


def test_heartbeat_goes_on_after_failures_and_ends_with_a_last_report(monkeypatch):
    service = Service(failures=1)
    assert beating(monkeypatch, service, 0.0, 3) == []
    assert service.put_at == [("/bridges/b", False)] * 2 + [("/bridges/b", True)]


def test_step_that_hangs_ends_the_process(monkeypatch, caplog):
    assert beating(monkeypatch, Service(), HANGS_S + 1, 1) == [70]
    assert "bridge_hangs" in caplog.text


@pytest.mark.parametrize(
    ("client_id", "name"),
    [("surefoot-bridge", "surefoot-bridge"), ("nvr east/1", "nvr-east-1"), ("x" * 99, "x" * 63)],
)
def test_name_of_a_bridge_fits_the_path(client_id, name):
    assert bridge_name(client_id) == name
