"""A real service with access on, as a stranger on the network meets it, and its commands."""

import os
import re
import shutil
import tempfile
import threading
from functools import partial
from pathlib import Path

import httpx
import pytest

from service.access import tokens
from service.access.tokens import TokenSpec
from service.api.middleware.scopes import NEEDS
from service.app import create_app
from service.commands import tokens as token_commands
from service.commands.replay import client_of
from service.data_dir import StartError
from service.settings import Settings
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.running import RunningService, free_port
from tests.service.access.test_access import bearer, filled, routes_of
from tests.service.commands import forked

pytestmark = pytest.mark.slow


def surefoot(settings, *command, code=0):
    environment = {**settings.as_environment(), "COLUMNS": "200"}
    with tempfile.TemporaryDirectory() as folder:
        done = forked.run(command, environment, Path(folder), timeout_s=60)
    assert done.returncode == code, done.stderr
    return (done.stdout if code == 0 else done.stderr).strip()


@pytest.fixture(scope="module")
def closed(migrated, tmp_path_factory):
    """A running service that lets in who has a token, its port on this machine alone."""
    folder = tmp_path_factory.mktemp("closed") / "data"
    shutil.copytree(migrated, folder)
    on = Settings(data_dir=folder, auth="on", port=free_port(), workers=0)
    with Store(on).write() as session:
        tokens.make_token(session, TokenSpec(name="first", scopes=("admin",)), None)
    running = RunningService(on)
    running.start()
    yield running
    running.stop()


def test_a_stranger_can_read_and_do_nothing(closed):
    with Store(closed.settings).write() as session:
        spec = TokenSpec(name="ada", scopes=("admin",))
        admin = bearer(tokens.make_token(session, spec, None).text)
    for camera_id in ("corner", "gate"):
        closed.http.post("/cameras", json={**CAMERA, "id": camera_id}, headers=admin)
    counted = ("/cameras", "/tokens", "/webhooks", "/alerts", "/cameras/corner/trainings")
    before = [closed.http.get(path, headers=admin).text for path in counted]
    asked = 0
    for method, path in routes_of(create_app(closed.settings)):
        if NEEDS[method, path] is None:
            continue
        answer = closed.http.request(
            method, filled(path), content=b"{}", headers={"If-Match": "*", "Accept": "*/*"}
        )
        asked += 1
        assert answer.status_code == 401, (method, path)
        assert "corner" not in answer.text
    assert asked > 50
    after = [closed.http.get(path, headers=admin).text for path in counted]
    # The first token has been used since: that alone may differ.
    assert [re.sub('"used_at":[^,]*', "", text) for text in after] == [
        re.sub('"used_at":[^,]*', "", text) for text in before
    ]
    assert closed.http.get("/healthz").status_code == 200
    assert closed.http.get("/readyz").status_code in (200, 503)
    assert closed.http.get("/metrics", headers=admin).status_code == 200


def test_a_token_that_is_revoked_is_let_in_no_more_and_its_stream_ends(closed):
    made = surefoot(closed.settings, "token", "add", "wall", "--scope", "read", "--expires", "90d")
    token_id = made.split("_")[1]
    listed = surefoot(closed.settings, "token", "list")
    assert token_id in listed
    assert made.split("_", 2)[2] not in listed
    ended = threading.Event()
    begun = threading.Event()

    def follow():
        with (
            httpx.Client(base_url=closed.url, timeout=60, headers=bearer(made)) as http,
            http.stream("GET", "/events") as stream,
        ):
            for line in stream.iter_lines():
                if "connected" in line:
                    begun.set()
        ended.set()

    threading.Thread(target=follow, daemon=True).start()
    assert begun.wait(10)
    surefoot(closed.settings, "token", "revoke", token_id)
    assert closed.http.get("/cameras", headers=bearer(made)).status_code == 401
    assert ended.wait(30)


def test_names_in_brackets_are_listed_as_they_are(closed):
    surefoot(closed.settings, "token", "add", "gate [/] [red]2", "--scope", "read")
    assert "gate [/] [red]2" in surefoot(closed.settings, "token", "list")


def test_a_replay_is_let_in_with_a_token(closed):
    with Store(closed.settings).write() as session:
        spec = TokenSpec(name="replay", scopes=("admin", "ingest"))
        text = tokens.make_token(session, spec, None).text
    for token, status in ((None, 401), (text, 200)):
        with client_of(closed.url, token) as http:
            assert http.get("/cameras").status_code == status


def test_it_starts_for_others_only_with_a_way_in(settings):
    lan = settings.model_copy(update={"host": "0.0.0.0", "port": free_port(), "workers": 0})
    line = surefoot(lan, "serve", code=1)
    assert re.fullmatch("surefoot: auth: .*`surefoot token add NAME --scope admin`.*", line)
    running = RunningService(lan.model_copy(update={"auth": "off"}))
    running.url = f"http://127.0.0.1:{lan.port}"
    running.http = httpx.Client(base_url=running.url, timeout=30)
    running.start()
    try:
        assert running.http.get("/cameras").status_code == 200
    finally:
        running.stop()
    assert "access_off" in running.log.read_text()


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (partial(token_commands.add, "x", ["root"]), "scopes: "),
        (partial(token_commands.add, "x", ["read"], expires="soon"), "expires: "),
        (partial(token_commands.add, "x", ["read"], expires="99999y"), "expires: "),
        (partial(token_commands.add, "x", ["read"], camera=["corner"]), "cameras: "),
        (partial(token_commands.revoke, "nobody"), "token_id: "),
    ],
)
def test_commands_refuse_in_one_line(settings, command, told):
    with pytest.raises(StartError, match=told) as refused:
        command(data_dir=settings.data_dir)
    assert "\n" not in str(refused.value)


def test_the_first_token_comes_before_the_first_start(tmp_path):
    empty = Settings(data_dir=tmp_path / "empty")
    text = surefoot(empty, "token", "add", "x", "--scope", "admin")
    assert re.fullmatch(r"sf_[0-9a-f]{12}_[\w-]{43}", text)
    assert os.stat(empty.database_path).st_mode & 0o077 == 0
