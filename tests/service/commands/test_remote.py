"""Commands that ask a running service: real processes over a fleet in a real store."""

import itertools
import json
import os
import subprocess
import sys

import pytest
from sqlalchemy import update

from service.access import tokens
from service.access.tokens import TokenSpec
from service.store.cameras import CameraRecord
from service.workers.processes.workers import register_worker
from tests.conftest import ROOT
from tests.running import free_port, served, wait_for
from tests.service.commands import forked
from tests.service.commands.test_command_line import HEAVY
from tests.service.fleet_bench import Fleet

pytestmark = pytest.mark.slow


@pytest.fixture
def running(tmp_path, migrated):
    """A service with a worker to all appearance, and cameras that stand still."""
    with served(tmp_path, migrated, worker_lost_s=1e6) as server:
        server.fleet = Fleet(server.settings)
        for name in ("gate", "hall"):
            server.fleet.add(name)
        with server.fleet.store.write() as session:
            register_worker(session, "made-up", 1)
            session.execute(update(CameraRecord).values(read_track_pk=1000))  # no track waits
        yield server
        server.fleet.close()


def ask(folder, server, *words, code=0, **variables):
    """What a command prints, line by line."""
    url = server if isinstance(server, str) else server.url
    inherited = {name: value for name, value in os.environ.items() if name != "SUREFOOT_TOKEN"}
    for old in folder.glob("std*"):
        old.unlink()
    ended = forked.run(words, {**inherited, "SUREFOOT_URL": url, **variables}, folder, timeout_s=60)
    assert ended.returncode == code, (ended.stdout, ended.stderr)
    if code == 2:
        assert not ended.stdout
        return ended.stderr.splitlines()
    assert not ended.stderr
    return ended.stdout.splitlines()


def test_the_status_is_for_people_for_programs_and_for_scripts(running, tmp_path):
    told = ask(tmp_path, running, "status")
    assert told[:2] == [f"{running.url}: ready", "cameras: 2 (2 ok)"]
    assert told[2:] == ["alerts that fire: none; 0 for a person"]
    seen = running.fleet.knock("gate", by="Ines")
    running.fleet.knock("hall", severity="warning")
    told = ask(tmp_path, running, "status", code=1)
    assert told[1] == "cameras: 2 (2 drifting)"
    assert told[2] == "alerts that fire: 2 (1 warning, 1 critical); 1 for a person"
    (line,) = ask(tmp_path, running, "status", "--json", code=1)
    document = json.loads(line)
    assert document["cameras"]["drifting"] == 2
    assert document["alerts"] == {"warning": 1, "critical": 1, "waiting": 1}
    assert document["readiness"]["status"] == "ready"
    alerts = [json.loads(line) for line in ask(tmp_path, running, "alerts", "--json", code=1)]
    assert {alert["camera_id"] for alert in alerts} == {"gate", "hall"}
    assert alerts == running.http.get("/alerts").json()["items"]
    (heading, row) = ask(tmp_path, running, "alerts", "--camera", "gate", code=1)
    assert row.startswith(seen)
    assert "acknowledged by Ines" in row
    assert row.index("critical") == heading.index("severity")
    running.http.post(f"/alerts/{seen}/resolve", json={"outcome": "put_back"})
    assert len(ask(tmp_path, running, "alerts", "--camera", "gate")) == 1
    assert len(ask(tmp_path, running, "alerts", "--camera", "gate", "--all")) == 2


def test_what_is_not_ready_is_no_0(tmp_path, migrated):
    with served(tmp_path, migrated) as server:
        told = ask(tmp_path, server, "status", code=1)
        assert told[0].endswith(": not ready")
        assert "problem: worker: none was ever heard of; up to 20 s are waited for" in told


def test_cameras_of_some_states_are_listed(running, tmp_path):
    running.fleet.add("new", state="unconnected", tracks=0)
    running.fleet.add("busy", name="The \x1b[31mbusy\x1b[0m one", state="learning", tracks=30)
    told = ask(tmp_path, running, "cameras", "--state", "learning", "--state", "unconnected")
    assert [line.split()[0] for line in told] == ["id", "busy", "new"]
    assert "learning, 30 of 200" in told[1]
    assert "\x1b" not in "".join(told)
    running.fleet.add("yard", site="campus/north", tags=("ptz",))
    told = ask(tmp_path, running, "cameras", "--site", "campus", "--tag", "ptz")
    assert [line.split()[0] for line in told] == ["id", "yard"]
    assert told[1].index("campus/north") == told[0].index("site")
    lines = ask(tmp_path, running, "cameras", "--json")
    assert [json.loads(line) for line in lines] == running.http.get("/cameras").json()["items"]


def test_alerts_are_acknowledged_by_name(running, tmp_path):
    ids = [running.fleet.knock(name) for name in ("gate", "hall")]
    assert len(ask(tmp_path, running, "alerts", "--waiting", code=1)) == 3
    told = ask(tmp_path, running, "ack", *ids, "--by", "Ada")
    assert told == [
        f"{ids[0]}: drift of gate, acknowledged by Ada",
        f"{ids[1]}: drift of hall, acknowledged by Ada",
    ]
    assert len(ask(tmp_path, running, "alerts", "--waiting")) == 1
    (line,) = ask(tmp_path, running, "ack", "nobody", code=2)
    assert line.startswith(f"surefoot: {running.url}: ")
    assert "'nobody'" in line
    ask(tmp_path, running, "ack", "../cameras", code=2)


@pytest.mark.nightly
def test_a_token_comes_by_a_variable_or_a_file_and_never_by_a_flag(tmp_path, migrated):
    with served(tmp_path, migrated, worker_lost_s=1e6) as server:
        fleet = Fleet(server.settings)
        with fleet.store.write() as session:
            register_worker(session, "made-up", 1)
            spec = TokenSpec(name="ada", scopes=("read",))
            token = tokens.make_token(session, spec, None).text
        fleet.close()
        server.start_again(auth="on")
        (line,) = ask(tmp_path, server, "status", code=2)
        assert "401 unauthorized" in line
        assert ask(tmp_path, server, "status", SUREFOOT_TOKEN=token)
        (tmp_path / "token").write_text(f"{token}\n")
        assert ask(tmp_path, server, "status", "--token-file", str(tmp_path / "token"))
        assert ask(tmp_path, server, "cameras", SUREFOOT_TOKEN_FILE=str(tmp_path / "token"))
        (line,) = ask(tmp_path, server, "ack", "x", SUREFOOT_TOKEN=token, code=2)
        assert "403 forbidden" in line
        (tmp_path / "token").write_text("two words")
        for file, why in (("token", "2 words"), ("none", "No such file")):
            given = ("--token-file", str(tmp_path / file))
            (line,) = ask(tmp_path, server, "status", *given, code=2)
            assert why in line
        assert "two words" not in line
        assert ask(tmp_path, server, "status", "--token", token, code=2)


@pytest.mark.parametrize("url", ["http://127.0.0.1:{port}", "nonsense", "http://[::1", "ftp://a"])
def test_what_cannot_be_asked_is_one_line_and_2(tmp_path, url):
    url = url.format(port=free_port())
    for command in ("status", "cameras", "alerts", "tail"):
        (line,) = ask(tmp_path, url, command, code=2)
        assert line.startswith(f"surefoot: {url}: ")


def test_who_follows_hears_all_of_what_happens_once_across_a_killed_service(running, tmp_path):
    out, err = tmp_path / "out", tmp_path / "err"
    environment = {**os.environ, "SUREFOOT_URL": running.url}
    numbers = itertools.count()
    following = forked.Forked(["tail", "--json"], environment, out, err)

    def heard():
        return [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []

    def heard_one():
        running.fleet.add(f"camera-{next(numbers)}")
        return heard()

    try:
        wait_for(heard_one)
        running.kill()
        wait_for(lambda: "the next try is in" in err.read_text())
        running.fleet.knock("gate")  # while nobody can be asked
        running.start()
        wait_for(lambda: [each for each in heard() if each["data"]["camera_id"] == "gate"])
        running.fleet.knock("hall")
        wait_for(lambda: heard()[-1]["data"]["camera_id"] == "hall")
    finally:
        following.terminate()
        assert following.wait(20) == 0
    assert {each["event"] for each in heard()} == {"pose", "training", "alert"}
    ids = [int(each["id"]) for each in heard()]
    assert ids == list(range(ids[0], ids[-1] + 1))


@pytest.mark.nightly
def test_a_stream_says_what_to_go_on_from_before_anything_happens(running):
    lines = []
    with running.http.stream("GET", "/events") as stream:
        for line in stream.iter_lines():
            lines.append(line)
            if not line:
                break
    running.fleet.knock("gate")
    (begun,) = [line.removeprefix("id: ") for line in lines if line.startswith("id: ")]
    with running.http.stream("GET", "/events", headers={"Last-Event-ID": begun}) as stream:
        data = next(line for line in stream.iter_lines() if line.startswith("data: "))
    assert json.loads(data.removeprefix("data: "))["camera_id"] == "gate"


def test_they_import_nothing_heavy():
    heavy = HEAVY - {"httpx", "pydantic"}  # typer reads the words of a command by pydantic
    program = (
        "import sys; sys.argv[1:] = ['status', '--url', 'http://127.0.0.1:9']\n"
        "from service.cli import main\n"
        "try: main()\n"
        f"except SystemExit as end: print(end.code, sorted({heavy} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", program]
    output = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert output.stdout.strip() == "2 []"


def test_a_shell_completes_commands_and_states(tmp_path):
    def complete(*words):
        asked = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
        return ask(tmp_path, "http://x", **asked, _SUREFOOT_COMPLETE="complete_bash")

    assert set(complete("surefoot", "a")) == {"alerts", "ack"}
    assert complete("surefoot", "cameras", "--state", "dr") == ["drifting"]
    script = ask(tmp_path, "http://x", _SUREFOOT_COMPLETE="source_bash")
    checked = subprocess.run(["bash", "-n"], input="\n".join(script), text=True, check=False)
    assert checked.returncode == 0
