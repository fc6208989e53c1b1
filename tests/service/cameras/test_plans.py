"""The plan of a camera's site: kept as pictures are, with its scale, gone with its camera."""

import math
from io import BytesIO

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image

from models.geometry.ground import pixel_from_ground
from models.geometry.pose import CameraPose
from service.app import create_app
from service.store.cameras import PlanRecord
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.cameras.test_snapshots import JPEG, PNG, image
from tests.service.conftest import problem
from tests.service.street import LENS

URL = "/cameras/corner/plan"
SCALE = {"metres_per_pixel": 0.05, "north_deg": 90}


@pytest.fixture
def allowed(settings):
    kept = settings.model_copy(update={"snapshots": "pictures"})
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    with TestClient(create_app(kept)) as client:
        assert client.post("/cameras", json=bare).status_code == 201
        yield client


@pytest.mark.parametrize("snapshots", ["off", "features"])
def test_no_plan_is_kept_where_no_picture_is(settings, snapshots):
    app = create_app(settings.model_copy(update={"snapshots": snapshots}))
    with TestClient(app) as http:
        http.post("/cameras", json=CAMERA)
        sent = http.put(URL, content=image(), headers=JPEG, params=SCALE)
        assert "SUREFOOT_SNAPSHOTS" in problem(sent, 403, "switched_off")["detail"]
        problem(http.get(URL), 403, "switched_off")
        problem(http.delete(URL), 404, "not_found")


def test_a_plan_is_made_smaller_and_its_pixels_are_larger(allowed, settings):
    problem(allowed.get(URL), 404, "not_found")
    exif = Image.Exif()
    exif[0x010E] = "a place and a name"
    sent = image(3840, 1000, exif=exif)
    body = allowed.put(URL, content=sent, headers=JPEG, params=SCALE).raise_for_status().json()
    assert (body["width"], body["height"]) == (1920, 500)
    assert body["metres_per_pixel"] == pytest.approx(0.1)
    assert body["north_deg"] == pytest.approx(90)
    answer = allowed.get(URL)
    assert Image.open(BytesIO(answer.content)).size == (1920, 500)
    assert b"a place and a name" not in answer.content
    again = allowed.get(URL, headers={"If-None-Match": answer.headers["ETag"]})
    assert again.status_code == 304
    # One that lies on its side is measured as it is seen.
    exif[0x0112] = 6
    turned = image(1000, 3840, exif=exif)
    body = allowed.put(URL, content=turned, headers=JPEG, params=SCALE).json()
    assert (body["width"], body["metres_per_pixel"]) == (1920, pytest.approx(0.1))
    assert allowed.delete(URL).status_code == 204
    problem(allowed.get(URL), 404, "not_found")
    said = [each["what"] for each in allowed.get("/activity").json()["items"]]
    assert (said.count("plan.kept"), said.count("plan.removed")) == (2, 1)
    allowed.put(URL, content=image(), headers=JPEG, params=SCALE).raise_for_status()
    allowed.delete("/cameras/corner", headers={"If-Match": "*"})
    store = Store(settings)
    with store.read() as session:
        assert session.get(PlanRecord, "corner") is None
    store.close()


@pytest.mark.parametrize(
    ("content", "headers", "query", "status", "code"),
    [
        (b"\xff\xd8\xff nothing", JPEG, SCALE, 422, "malformed"),
        (image(9000, 5700, form="PNG", mode="1"), PNG, SCALE, 413, "too_large"),
        (b"\xff" * (8 * 1024 * 1024 + 1), JPEG, SCALE, 413, "too_large"),
        (image(), {"Content-Type": "image/gif"}, SCALE, 415, "unsupported_media_type"),
        (image(), JPEG, {}, 422, "malformed"),
        (image(), JPEG, {"metres_per_pixel": 0}, 422, "malformed"),
        (image(), JPEG, {"metres_per_pixel": "NaN"}, 422, "malformed"),
        (image(), JPEG, SCALE | {"north_deg": 361}, 422, "malformed"),
    ],
)
def test_what_is_no_plan_is_refused(allowed, content, headers, query, status, code):
    problem(allowed.put(URL, content=content, headers=headers, params=query), status, code)
    problem(allowed.get(URL), 404, "not_found")


def test_places_of_a_coarse_map_make_the_pose_less_sure(allowed):
    pose = CameraPose(height_m=6.0, tilt_rad=math.radians(22), roll_rad=0.0, heading_rad=0.5)
    places = np.array([[2.0, 14.0], [9.0, 11.0]])
    seen, _ = pixel_from_ground(LENS, pose.rotation, pose.centre_m, places)

    def sure(**said):
        marks = [
            {"kind": "map_point", "points": [at], "x_m": x, "y_m": y, **said}
            for at, (x, y) in zip(seen.tolist(), places.tolist(), strict=True)
        ]
        answer = allowed.put("/cameras/corner/hints", json=marks).raise_for_status().json()
        assert [each["sd_m"] for each in answer["items"]] == [said.get("sd_m")] * 2
        return answer["proposed"]["sd"]["heading_deg"]

    assert sure() == sure(sd_m=0.1)
    assert sure(sd_m=2.0) > 2 * sure()
    length = {"kind": "length", "points": [[1, 700], [900, 700]], "length_m": 3.0, "sd_m": 1.0}
    problem(allowed.put("/cameras/corner/hints", json=[length]), 422, "malformed")
