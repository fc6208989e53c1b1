"""A camera that nobody has calibrated: registered by its lens, its pose agreed to on its page."""

import math
import re

import numpy as np
import pytest

from service.workers.estimate import run_estimate
from tests.browser.camera.conftest import URL
from tests.browser.conftest import axe, shoot, too_wide
from tests.conftest import CAMERA
from tests.service.street import LENS, PRIOR, Street

pytestmark = pytest.mark.slow


def people_tell(server):
    """Have 60 people walk past the camera, and a look at them."""
    street = Street(server.http, server.settings)
    try:
        street.keep_to_lanes(PRIOR, 60)
        run_estimate(street.context, "corner")
    finally:
        street.close()


@pytest.fixture
def expect():
    return pytest.importorskip("playwright.sync_api").expect


def test_a_lens_is_registered_people_tell_the_pose_and_somebody_agrees(server, empty, page, expect):
    page.goto("/ui/register")
    for name, value in {"name": "Corner", "id": "corner", "width": "1280", "height": "720"}.items():
        page.fill(f"#{name}", value)
    page.fill("#fx", "1100")
    page.get_by_label("Unknown: people will tell").check()
    expect(page.locator("#measured_height_m")).to_be_visible()
    expect(page.locator("#height_m")).to_be_hidden()
    shoot(page, "register-unknown")
    page.get_by_role("button", name="Add this camera").click()
    page.wait_for_url(re.compile(URL))
    expect(page.locator("section[data-state]")).to_have_attribute("data-state", "unconnected")

    people_tell(server)
    proposed = page.locator("[data-part=proposed]")
    expect(proposed).to_contain_text("60 tracks")
    expect(page.locator("section[data-state]")).to_have_attribute("data-state", "uncalibrated")
    assert axe(page) == []
    assert not too_wide(page)
    shoot(page, "uncalibrated")
    page.get_by_role("button", name="agree to it").click()
    page.get_by_role("button", name="Agree to it", exact=True).click()
    page.fill("#name-field", "Ada")
    page.get_by_role("button", name="Go on").click()
    expect(page.locator("section[data-state]")).to_have_attribute("data-state", "learning")
    expect(proposed).to_have_count(0)


@pytest.fixture
def waiting(server, empty, page, expect):
    """The page of a camera that 60 people have told of."""
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    server.http.post("/cameras", json=bare).raise_for_status()
    people_tell(server)
    page.goto(URL)
    return page


def on_screen(page, forward_m, right_m, up_m=0.0):
    """Where a place of the street is on the screen."""
    sine, cosine = math.sin(PRIOR.heading_rad), math.cos(PRIOR.heading_rad)
    place = (forward_m * sine + right_m * cosine, forward_m * cosine - right_m * sine, up_m)
    (at,), _ = LENS.project((np.array([place]) - PRIOR.centre_m) @ PRIOR.rotation.T)
    svg = page.locator("[data-part=picture] svg.picture")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    return (
        box["x"] + (at[0] + 0.5) / LENS.width * box["width"],
        box["y"] + (at[1] + 0.5) / LENS.height * box["height"],
    )


def test_a_vertical_is_drawn_by_mouse_and_makes_the_height_surer(waiting, server, expect):
    page = waiting
    proposed = page.locator("[data-part=proposed]")
    expect(proposed).to_contain_text("±")
    before = server.http.get("/cameras/corner/hints").json()["proposed"]["sd"]["height_m"]
    foot, top = on_screen(page, 12, -3), on_screen(page, 12, -3, 2.5)
    page.mouse.move(*foot)
    page.mouse.down()
    page.mouse.move(*top, steps=4)
    page.mouse.up()
    expect(page.locator("polyline.mark.new")).to_have_count(1)
    page.fill("#hint-length", "2.5")
    page.get_by_role("button", name="Add the mark").click()
    row = page.locator("#hint-list li")
    expect(row).to_contain_text("Vertical of 2.5 m")
    after = server.http.get("/cameras/corner/hints").json()
    assert after["proposed"]["sd"]["height_m"] < before / 2
    assert after["items"][0]["off_sd"] < 2
    assert axe(page) == []
    assert not too_wide(page)
    shoot(page, "hints")
    row.get_by_role("button", name="Take back").click()
    expect(row).to_have_count(0)
    assert server.http.get("/cameras/corner/hints").json()["items"] == []


def test_a_length_is_typed_by_keyboard_and_a_refusal_keeps_what_was_typed(waiting, server, expect):
    page = waiting
    page.locator("#hint-kind").focus()
    page.keyboard.type("A len")
    page.keyboard.press("Tab")
    page.keyboard.type("400 600")
    page.keyboard.press("Tab")
    page.keyboard.type("800, 610")
    page.keyboard.press("Enter")
    expect(page.locator("#hint-says")).to_contain_text("length_m")
    expect(page.locator("#hint-to")).to_have_value("800, 610")
    page.keyboard.press("Tab")
    page.keyboard.type("4")
    page.keyboard.press("Enter")
    expect(page.locator("#hint-list li")).to_contain_text("Length of 4 m")
    (kept,) = server.http.get("/cameras/corner/hints").json()["items"]
    assert (kept["kind"], kept["points"]) == ("length", [[400, 600], [800, 610]])


def test_a_finger_draws_the_horizon(waiting, browser, server, expect):
    finger = browser.new_context(has_touch=True, base_url=server.url).new_page()
    finger.goto(URL)
    finger.select_option("#hint-kind", "horizon")
    svg = finger.locator("[data-part=picture] svg.picture")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    devtools = finger.context.new_cdp_session(finger)
    for kind, share in (("touchStart", 0.2), ("touchMove", 0.5), ("touchMove", 0.8)):
        at = {"x": box["x"] + share * box["width"], "y": box["y"] + 0.1 * box["height"]}
        devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [at]})
    devtools.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    expect(finger.locator("polyline.mark.new")).to_have_count(1)
    u, v = map(float, finger.locator("#hint-to").input_value().split())
    assert u == pytest.approx(0.8 * LENS.width, abs=4)
    assert v == pytest.approx(0.1 * LENS.height, abs=4)
    finger.context.close()
