"""The map of a site: who stands where, what it sees, and what has no place."""

import re

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from tests.conftest import CAMERA
from tests.service.fleet_bench import Fleet


@pytest.fixture
def http(settings):
    with TestClient(create_app(settings)) as client:
        client.settings = settings
        yield client


def at(http, camera_id, x_m, y_m, site="yard"):
    pose = {**CAMERA["prior_pose"], "x_m": x_m, "y_m": y_m}
    body = {**CAMERA, "id": camera_id, "name": f"The <{camera_id}>", "site": site}
    http.post("/cameras", json={**body, "prior_pose": pose}).raise_for_status()


def circles(page):
    found = re.findall(r'href="/ui/cameras/(\w+)".*?cx="([\d.]+)" cy="([\d.]+)"', page)
    return {name: (float(x), float(y)) for name, x, y in found}


def test_cameras_are_where_their_poses_say(http):
    at(http, "west", 0, 0)
    at(http, "east", 30, 0)
    at(http, "north", 0, 40)
    at(http, "far", 500, 500, site="elsewhere")
    found = circles(http.get("/ui/map?site=yard").text)
    assert set(found) == {"west", "east", "north"}
    west, east, north = (np.array(found[name]) for name in ("west", "east", "north"))
    # One scale, +Y up: 40 m are 4/3 of 30 m.
    assert east[1] == west[1]
    assert north[0] == west[0]
    assert (west[1] - north[1]) / (east[0] - west[0]) == pytest.approx(4 / 3, abs=0.01)
    assert set(circles(http.get("/ui/map").text)) == {"west", "east", "north", "far"}


def test_cameras_without_a_place_are_listed_beside(http):
    at(http, "here", 5, 5)
    for name in ("one", "two"):
        at(http, name, 0, 0)
    page = http.get("/ui/map").text
    assert set(circles(page)) == {"here"}
    assert "The &lt;one&gt;" in page.split("Without a place")[1]
    assert "<one>" not in page
    assert "has a place on the ground yet" in http.get("/ui/map?site=nowhere").text


@pytest.mark.parametrize(
    ("state", "kinds"), [("ok", ["served"]), ("drifting", ["prior", "served"])]
)
def test_a_camera_that_moved_shows_where_it_should_look_and_where_it_does(settings, state, kinds):
    fleet = Fleet(settings)
    fleet.add("gate", state=state, tilt_deg=2.0, pan_deg=10.0)
    if state == "drifting":
        fleet.knock("gate")
    fleet.close()
    with TestClient(create_app(settings)) as http:
        page = http.get("/ui/map").text
    (drawn,) = re.findall(
        r'<a href="/ui/cameras/gate" class="(\w+)" aria-label="(.*?)">(.*?)</a>', page
    )
    assert drawn[0] == state
    assert re.findall(r'class="view (\w+)"', drawn[2]) == [*kinds, "leads"]
