"""`surefoot demo` on a busy machine: it waits, or ends with one line."""

import subprocess
import sys
import textwrap

import httpx
import pytest

from service.commands import demo
from service.data_dir import StartError
from service.settings import Settings


@pytest.fixture
def asleep():
    """A process that runs until the test ends."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        yield process
        process.kill()


def answering(*answers):
    """A client whose requests get these answers, one after the other."""
    left = list(answers)

    def answer(request):
        found = left.pop(0)
        if isinstance(found, Exception):
            raise found
        return found

    return httpx.Client(transport=httpx.MockTransport(answer), base_url="http://demo"), left


def test_busy_service_is_asked_again(asleep):
    """A timeout or a 503 ended the demo in a traceback."""
    http, left = answering(httpx.ReadTimeout("busy"), httpx.Response(503), httpx.Response(201))
    demo._wait(lambda: demo._registered(http), asleep, "registered the camera")
    assert left == []


def test_camera_registered_by_a_request_that_timed_out_is_taken(asleep):
    http, left = answering(httpx.ReadTimeout("busy"), httpx.Response(409))
    demo._wait(lambda: demo._registered(http), asleep, "registered the camera")
    assert left == []


def test_refused_request_is_not_repeated(asleep):
    http, left = answering(httpx.Response(422), httpx.Response(201))
    with pytest.raises(httpx.HTTPStatusError, match="422"):
        demo._wait(lambda: demo._registered(http), asleep, "registered the camera")
    assert len(left) == 1


def test_step_that_takes_too_long_ends_with_one_line(asleep, monkeypatch):
    monkeypatch.setattr(demo, "_PATIENCE_S", 0.3)
    with pytest.raises(StartError) as ended:
        demo._wait(lambda: False, asleep, "estimated from the newest tracks")
    assert str(ended.value) == (
        "demo: its service has not estimated from the newest tracks within 0 s; try again when "
        "the machine is less busy"
    )


def test_service_that_ended_is_not_waited_for(asleep):
    asleep.kill()
    asleep.wait()
    with pytest.raises(StartError, match="its service ended with -9, see above"):
        demo._wait(lambda: False, asleep, "started")


def test_service_that_does_not_stop_in_time_is_killed(tmp_path, monkeypatch, capfd):
    """After the alert was printed, the demo ended in a traceback of 25 lines."""
    stubborn = """
    import signal, time
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    print("up", flush=True)
    time.sleep(60)
    """
    command = [sys.executable, "-c", textwrap.dedent(stubborn)]
    monkeypatch.setattr(demo, "command_of", lambda *words: command)
    monkeypatch.setattr(demo, "_STOP_S", 0.2)
    with demo._service(Settings(data_dir=tmp_path)) as process:
        while "up" not in (tmp_path / "serve.log").read_text():
            pass
    assert process.returncode == -9
    assert capfd.readouterr() == ("", "")
