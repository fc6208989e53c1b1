"""What the panel "Connect tracks" says of a camera that learns, over a real store."""

import html
import re
import time
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from service.cameras.connecting import view_connection
from service.cameras.post_log import PostLog
from service.setting_values import read_camera_names
from service.settings import Settings
from service.store import references
from service.store.engines.store import Store
from service.store.tracks import TrackRecord
from service.wording.connecting import delay_words, ready_words
from tests.conftest import CAMERA, track
from tests.service.bench import moved

URL = "/ui/cameras/corner"


def text_of(page):
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())


def posts(http):
    answer = http.get(f"{URL}/posts")
    assert answer.status_code == 200, answer.text
    return text_of(answer.text)


def test_a_new_camera_has_commands_with_its_address_id_and_size(corner):
    page = corner.get(URL).text
    commands = html.unescape(re.sub(r"<[^>]+>", "", page))
    assert "Connect tracks" in page
    assert "curl -sS http://testserver/cameras/corner/tracks" in commands
    assert '"size": [1280, 720], "tracks": []' in commands
    assert "frame_rate_hz=25&started_at=" in commands
    assert 'with Client("http://testserver", "corner",\n            source="tracker",' in commands
    assert "size=(1280, 720)) as client:" in commands
    assert "Authorization" not in commands  # access is off
    assert "none yet" in posts(corner)


def test_the_bridges_settings_are_this_cameras(http, monkeypatch):
    http.post("/cameras", json=CAMERA | {"id": "town-centre"}).raise_for_status()
    page = http.get("/ui/cameras/town-centre").text
    block = html.unescape(re.sub(r"<[^>]+>", "", page.split('id="bridge"')[1].split("</pre>")[0]))
    *lines, last = block.partition(">")[2].strip().splitlines()
    assert last == "surefoot bridge"
    given = dict(line.removeprefix("export ").split("=", 1) for line in lines)
    assert given.pop("SUREFOOT_URL") == "http://testserver"
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    settings = Settings()
    assert settings.mqtt_url == "mqtt://BROKER:1883"
    assert read_camera_names(settings.mqtt_cameras) == {"town_centre": "town-centre"}


def test_a_reference_of_one_morning_says_so_once_most_people_are_there(corner, settings):
    batch = [track(str(n), start_s=time.time() - 3600 - n) for n in range(150)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()
    store = Store(settings)

    def said(**known):
        with store.write() as session:
            reference = references.newest(session, "corner")
            for name, value in known.items():
                setattr(reference, name, value)
        return posts(corner), text_of(corner.get(URL).text)

    assert all("of 3 hours only, as of one morning" in page for page in said(hours=3))
    assert all("of a single hour only" in page for page in said(hours=1))
    assert not any("hours only" in page for page in said(hours=9))
    assert not any("hours only" in page for page in said(hours=3, pieces=80))  # of 70 people
    ready = {"ready_at": datetime.now(UTC), "tracks": 200, "data": b"made up", "pieces": 0}
    assert all("of 3 hours only" in page for page in said(**ready, walking_speed_mps=1.3))
    store.close()


def test_the_first_command_tries_the_connection_and_stores_nothing(corner):
    page = corner.get(URL).text
    command = html.unescape(re.sub(r"<[^>]+>", "", page.split('id="try"')[1].split("</pre>")[0]))
    body = re.search(r"-d '(.*)'", command, re.S)[1]
    headers = {"Content-Type": "application/json"}
    answer = corner.post("/cameras/corner/tracks", content=body, headers=headers)
    assert (answer.status_code, answer.json()["accepted"]) == (202, 0)
    assert "Last post 0 s ago" in posts(corner)
    assert corner.get("/cameras/corner/pose").json()["state"] == "unconnected"


def test_what_was_refused_is_said_with_what_would_mend_it(corner):
    now_s = time.time()
    short = {"id": "<b>brief</b>", "points": track("x", start_s=now_s - 60)["points"][:2]}
    good = [track(str(n), start_s=now_s - 20 - n) for n in range(5)]
    corner.post("/cameras/corner/tracks", json={"tracks": [*good, short]})
    assert "<b>brief" not in corner.get(f"{URL}/posts").text
    said = posts(corner)
    assert "5 taken, 0 known before, 1 refused" in said
    assert "1 too_short: The tracker loses people" in said
    assert "<b>brief</b>: too_short: 2 points over 0.4 s" in said
    assert "5.0 tracks a minute" in said
    assert re.search(r"Tracks come 1[2-9] s after their end: the clocks agree", said), said
    assert "5 of 200 people: ready" in said
    assert "ready in about 39 minutes at this rate" in said  # 195 people at 5 a minute


def test_a_reference_that_is_ready_needs_no_panel(bench):
    bench.see(moved())
    assert "Connect tracks" not in bench.http.get(URL).text
    assert 'data-ready="yes"' in bench.http.get(f"{URL}/posts").text
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    assert "Connect tracks" in bench.http.get(URL).text


def test_only_what_came_lately_is_a_rate(corner, settings):
    batch = [track(str(n), start_s=time.time() - 3600 - n) for n in range(30)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()
    store = Store(settings)

    def rate_after(age):
        with store.write() as session:
            session.execute(update(TrackRecord).values(received_at=datetime.now(UTC) - age))
        with store.read() as session:
            return view_connection(session, settings, PostLog(), "corner").rate_hz

    assert rate_after(timedelta(seconds=5)) == pytest.approx(0.5, rel=0.05)  # of a minute, at least
    assert rate_after(timedelta(minutes=5)) == pytest.approx(0.1, rel=0.05)
    assert rate_after(timedelta(minutes=11)) is None
    store.close()


def test_pieces_make_the_wait_longer(corner, settings):
    batch = [track(str(n), start_s=time.time() - 3600 - n) for n in range(30)]
    corner.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()
    store = Store(settings)
    waits = []
    for pieces in (0, 15):
        with store.write() as session:
            references.newest(session, "corner").pieces = pieces
        with store.read() as session:
            found = view_connection(session, settings, PostLog(), "corner")
        waits.append(found.ready_in_s)
    store.close()
    assert waits == pytest.approx([170 / 0.5, 185 / 0.25], rel=0.05)


def test_clocks_that_differ_are_told_from_portions_and_recordings():
    assert delay_words(2.0, 3.0) == "Tracks come 3.0 s after their end: the clocks agree."
    assert "ahead of this service's" in delay_words(-30.0, -28.0)
    assert "2 hours after their end: whole hours look like a wrong time zone" in delay_words(
        7_190.0, 7_210.0
    )
    assert "of a recording that is so" in delay_words(86_000.0, 864_000.0)


def test_nobody_is_missing_where_all_are_there():
    assert ready_words(200, 200, 0.0) == "everybody is there: it is learned at the next look"
    assert ready_words(0, 200, None) == "200 people are missing"
    assert ready_words(199, 200, None) == "1 person is missing"
