"""Connecting a new camera by its page alone: a token, a command, a file, and what comes of them."""

import contextlib
import json
import re
import shutil
import subprocess
import sys
import time
from datetime import UTC, datetime

import pytest

from service.access import tokens
from service.access.tokens import TokenSpec
from service.settings import Settings
from service.store import references
from service.store.engines.store import Store
from tests.browser.camera.conftest import URL
from tests.browser.conftest import axe, shoot, too_wide, watched
from tests.conftest import CAMERA, track
from tests.running import RunningService, free_port

pytestmark = pytest.mark.slow


@pytest.fixture
def expect():
    return pytest.importorskip("playwright.sync_api").expect


@pytest.fixture
def new(server, empty):
    server.http.post("/cameras", json=CAMERA).raise_for_status()
    return server.http


def run(command):
    """What a command prints that was copied from the page, as a shell runs it."""
    shell = ["bash", "-c", command]
    return json.loads(subprocess.run(shell, capture_output=True, check=True, timeout=30).stdout)


def walk_by(program, folder):
    """How a program of the page ends that sees one person walk."""
    fetch, *lines = program.splitlines()
    subprocess.run(["bash", "-c", fetch.lstrip("# ")], cwd=folder, check=True, timeout=30)
    added = "client.add(track_id, (x1, y1, x2, y2))"
    assert added in program
    walk = "[client.add(7, (300 + n, 200, 360 + n, 400), 1.7e9 + n) for n in range(9)]"
    program = "\n".join(lines).replace(added, walk)
    alone = [sys.executable, "-S", "-c", program]
    return subprocess.run(alone, cwd=folder, check=True, timeout=30).returncode


def people(count, ended_ago_s=20):
    start_s = time.time() - ended_ago_s
    return [track(str(n), start_s=start_s - 8 - 3 * n) for n in range(count)]


def test_a_copied_command_connects_and_the_page_tells_within_seconds(page, new, expect):
    page.goto(URL)
    expect(page.locator(".headline")).to_contain_text("Nobody has posted")
    page.locator("#posts dl").wait_for()
    assert axe(page) == []
    page.get_by_label("Name of the tracker").fill('it\'s "mine"')
    assert run(page.locator("#try").inner_text())["accepted"] == 0
    expect(page.locator("#last-post")).to_have_text(re.compile(r"^\d s ago$"))
    bad = {"id": "brief", "points": track("x")["points"][:3]}
    body = {"source": 'it\'s "mine"', "tracks": [*people(12), bad]}
    new.post("/cameras/corner/tracks", json=body).raise_for_status()
    expect(page.locator("#posted")).to_have_text("12 taken, 0 known before, 1 refused")
    expect(page.locator("#posts")).to_contain_text("too_short: The tracker loses people")
    expect(page.locator(".headline")).to_have_text("Learning: 12 of 200 people.")
    page.locator("#posts summary").click()
    expect(page.locator(".refusals")).to_contain_text("brief: too_short: 3 points over 0.8 s")
    page.wait_for_timeout(3500)  # the next look leaves open what is open
    expect(page.locator(".refusals")).to_be_visible()
    assert axe(page) == []
    shoot(page, "connect-desktop")
    for width in (390, 360):
        page.set_viewport_size({"width": width, "height": 844})
        assert too_wide(page) <= 0, width
    assert axe(page) == []
    shoot(page, "connect-phone")
    page.emulate_media(color_scheme="dark")
    assert axe(page) == []
    shoot(page, "connect-phone-dark")


def test_a_file_is_posted_by_its_ending(page, new, expect, tmp_path):
    body = people(8)
    (tmp_path / "a.json").write_text(json.dumps({"source": "file", "tracks": body[:3]}))
    (tmp_path / "b.ndjson").write_text("".join(f"{json.dumps(each)}\n" for each in body[3:]))
    rows = [f"{25 * k},1,{500 + 9 * k},300,60,200,1,-1,-1,-1" for k in range(1, 20)]
    (tmp_path / "c.txt").write_text("\n".join(rows) + "\n")
    (tmp_path / "d.png").write_bytes(b"PNG")
    page.goto(URL)
    choose, says = page.locator("#tracks-file"), page.locator("#drop-says")
    choose.set_input_files(tmp_path / "a.json")
    expect(says).to_have_text("a.json: 3 taken, 0 known before, 0 refused.")
    page.get_by_label("Name of the tracker").fill("file")
    choose.set_input_files(tmp_path / "b.ndjson")
    expect(says).to_have_text("b.ndjson: 5 taken, 0 known before, 0 refused.")
    choose.set_input_files(tmp_path / "b.ndjson")
    expect(says).to_have_text("b.ndjson: 0 taken, 5 known before, 0 refused.")
    choose.set_input_files(tmp_path / "c.txt")
    expect(says).to_contain_text("is needed, because the table has frame numbers")
    expect(says).to_contain_text("started_at: ")
    page.get_by_label("Recording began").fill("2026-11-20T08:00:00")
    choose.set_input_files(tmp_path / "c.txt")
    expect(says).to_have_text("c.txt: 1 taken, 0 known before, 0 refused.")
    choose.set_input_files(tmp_path / "d.png")
    expect(says).to_contain_text("a file that ends in .json")
    page.evaluate(
        """name => {
          const data = new DataTransfer();
          data.items.add(new File(['{"tracks": []}'], name));
          const made = { dataTransfer: data, bubbles: true, cancelable: true };
          document.getElementById("drop").dispatchEvent(new DragEvent("drop", made));
        }""",
        "dropped.json",
    )
    expect(says).to_have_text("dropped.json: 0 taken, 0 known before, 0 refused.")
    assert new.get("/cameras/corner/pose").json()["reference"]["tracks"] == 9
    assert [each["name"] for each in new.get("/cameras/corner/sources").json()["items"]] == ["file"]


def test_the_panel_goes_once_the_reference_is_there(page, server, new, expect):
    page.goto(URL)
    page.locator("#posts dl").wait_for()
    with contextlib.closing(Store(server.settings)) as store, store.write() as session:
        reference = references.newest(session, "corner")
        reference.ready_at, reference.tracks, reference.hours = datetime.now(UTC), 200, 2
        reference.data, reference.walking_speed_mps = b"made up", 1.3
    expect(page.locator("#connect")).to_have_count(0)
    expect(page.locator(".headline")).to_contain_text("Waiting for people")
    said = page.locator('[data-part="reference"]')
    expect(said).to_contain_text("Reference learned of 200 people of 2 different hours")


@pytest.fixture(scope="module")
def closed(tmp_path_factory, migrated):
    """A service that asks for tokens, with a camera, and the tokens of two people."""
    folder = tmp_path_factory.mktemp("closed")
    shutil.copytree(migrated, folder / "data")
    settings = Settings(data_dir=folder / "data", workers=0, port=free_port(), auth="on")
    with Store(settings).write() as session:
        made = [
            tokens.make_token(session, TokenSpec(name=name, scopes=(scope,)), None).text
            for name, scope in (("ada", "admin"), ("bo", "read"))
        ]
    server = RunningService(settings)
    server.http.headers["Authorization"] = f"Bearer {made[0]}"
    server.start()
    server.http.post("/cameras", json=CAMERA).raise_for_status()
    yield server, *made
    server.stop()


def logged_in(page, token):
    page.goto(f"/ui/login?next={URL}")
    page.get_by_label("Your token").fill(token)
    page.get_by_role("button", name="Log in").click()
    page.locator("#connect dl").wait_for()


@pytest.mark.nightly
def test_a_token_is_made_there_and_posts_for_this_camera_alone(browser, closed, expect, tmp_path):
    server, admin, _ = closed
    (tmp_path / "a.json").write_text(json.dumps({"source": "tracker", "tracks": people(4)}))
    with watched(browser, server) as (page, wrong):
        logged_in(page, admin)
        page.locator("#tracks-file").set_input_files(tmp_path / "a.json")
        expect(page.locator("#drop-says")).to_contain_text("make a token first")
        page.get_by_role("button", name="Make a token").click()
        expect(page.locator("#made-token")).to_contain_text("sf_")
        command = page.locator("#try").inner_text()
        assert run(command)["accepted"] == 0
        assert run(command.replace("/corner/", "/other/"))["code"] == "forbidden"
        page.locator("#tracks-file").set_input_files(tmp_path / "a.json")
        expect(page.locator("#drop-says")).to_contain_text("4 taken")
        assert walk_by(page.locator("#python").inner_text(), tmp_path) == 0
        expect(page.locator("#posted")).to_contain_text("5 taken")
        expect(page.locator(".headline")).to_have_text("Learning: 5 of 200 people.")
        bridge = page.locator("#bridge").inner_text()
        assert "export SUREFOOT_TOKEN=TOKEN" in bridge  # this one cannot read
        assert "export SUREFOOT_MQTT_CAMERAS=corner=corner" in bridge
        assert axe(page) == []
        shoot(page, "connect-token")
        (made,) = [each for each in server.http.get("/tokens").json()["items"] if each["cameras"]]
        assert (made["scopes"], made["cameras"]) == (["ingest"], ["corner"])
        assert made["created_by"] == "ada"
    assert wrong == []


def test_who_may_make_none_is_told_whom_to_ask(browser, closed, expect):
    server, _, reader = closed
    with watched(browser, server) as (page, wrong):
        logged_in(page, reader)
        expect(page.locator("#connect")).to_contain_text("Ask an administrator for a token")
        expect(page.get_by_role("button", name="Make a token")).to_have_count(0)
        expect(page.locator("#try")).to_contain_text("Bearer TOKEN")
        assert axe(page) == []
    assert wrong == []
