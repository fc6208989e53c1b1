"""Registration in a browser: a wrong sign is seen and mended, tracks are tried, a camera comes."""

import cv2
import numpy as np
import pytest

from tests.browser.conftest import axe, shoot, too_wide
from tests.running import served
from tests.service.cameras.test_registration import ANGLES, LENS, POSE, walks

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated):
    with served(tmp_path_factory.mktemp("registration"), migrated) as running:
        yield running


def fill(page, **fields):
    for name, value in fields.items():
        page.locator(f"#{name}").fill(value)


def mot_file(folder, **how):
    lines = [
        f"{frame:.0f},{n},{u - 30:.1f},{v - 180:.1f},60,180,1,-1,-1,-1"
        for n, walk in enumerate(walks(**how), start=1)
        for frame, u, v in walk
    ]
    path = folder / "tracks.txt"
    path.write_text("\n".join(lines))
    return path


def test_a_wrong_sign_is_seen_and_mended(page, server):
    page.goto("/ui/register")
    fill(page, name="Town Centre", **LENS, **{**ANGLES, "tilt_deg": "-20.04"})
    said = page.locator("#says .banner.critical")
    said.wait_for()
    assert "there is no ground in the picture" in said.inner_text()
    assert page.locator("#picture .grid").count() == 0
    shoot(page, "register-wrong-sign")
    page.get_by_role("button", name="Make it 20.04").click()
    page.locator("#picture .grid").wait_for()
    assert page.locator("#says .banner.critical").count() == 0
    assert page.locator("#tilt_deg").input_value() == "20.04"
    shoot(page, "register")
    page.route("**/ui/cameras/*", lambda route: route.fulfill(body="here"))
    page.get_by_role("button", name="Add this camera").click()
    page.wait_for_url("**/ui/cameras/town-centre")
    assert server.http.get("/cameras/town-centre").json()["name"] == "Town Centre"


def test_fields_that_are_wrong_say_so(page, server):
    page.goto("/ui/register")
    fill(page, **LENS, id="Not An Id")
    page.get_by_role("button", name="Add this camera").click()
    page.locator("#id:focus").wait_for()  # the first of them
    assert "lower-case letters" in page.locator("#id-error").inner_text()
    assert page.locator("#height_m-error").inner_text() == "is required"
    assert page.locator("#height_m").get_attribute("aria-invalid") == "true"
    fill(page, id="corner")
    page.get_by_role("button", name="Add this camera").click()
    page.locator("#height_m:focus").wait_for()


def test_recorded_tracks_are_tried(page, tmp_path):
    page.goto("/ui/register")
    lens = {**LENS, "distortion": ""}
    fill(page, **lens, **ANGLES, frame_rate_hz="25")
    page.locator("#picture .grid").wait_for()
    page.locator("#tracks").set_input_files(mot_file(tmp_path))
    good = page.locator("#says .banner.good")
    good.wait_for()
    assert "People walk at 1.3" in good.inner_text()
    assert page.locator("#picture .track").count() == 1
    assert page.locator("#ground .track").count() == 1
    shoot(page, "register-tracks")
    assert axe(page) == []
    fill(page, height_m="23.5")
    fast = page.locator("#says .banner.critical")
    fast.wait_for()
    assert "The height or the frame rate is wrong" in fast.inner_text()


def test_an_opencv_file_fills_the_form(page, tmp_path):
    path = tmp_path / "calibration.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 1920)
    storage.write("image_height", 1080)
    storage.write("camera_matrix", np.array([[2696.36, 0, 959.5], [0, 2696.36, 539.5], [0, 0, 1]]))
    storage.write("R", POSE.rotation)
    storage.write("t", POSE.translation_m)
    storage.release()
    page.goto("/ui/register")
    page.locator("#file").set_input_files(path)
    page.get_by_text("7.84 m high").wait_for()
    assert page.get_by_label("R and t").is_checked()
    assert page.locator("#height_m").is_hidden()
    shoot(page, "register-opencv")
    path = tmp_path / "other.yml"
    path.write_text("no calibration")
    page.locator("#file").set_input_files(path)
    page.get_by_text("must be a calibration, OpenCV").wait_for()


def test_what_was_typed_outlives_a_reload(page):
    page.goto("/ui/register")
    fill(page, **LENS, **ANGLES)
    page.reload()
    assert page.locator("#tilt_deg").input_value() == "20.04"
    page.locator("#picture .grid").wait_for()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_it(page, scheme):
    page.emulate_media(color_scheme=scheme)
    page.goto("/ui/register")
    assert axe(page) == []
    fill(page, **LENS, **{**ANGLES, "tilt_deg": "-20.04"})
    page.locator("#says .banner.critical").wait_for()
    assert axe(page) == []
    page.get_by_role("button", name="Make it 20.04").click()
    page.locator("#picture .grid").wait_for()
    shoot(page, f"register-{scheme}")
    for width in (2560, 768, 360):
        page.set_viewport_size({"width": width, "height": 800})
        assert too_wide(page) <= 0, width
    shoot(page, f"register-{scheme}-phone")
