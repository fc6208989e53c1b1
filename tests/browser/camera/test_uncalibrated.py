"""A camera that nobody has calibrated: registered by its lens, its pose agreed to on its page."""

import math
import re

import numpy as np
import pytest
from PIL import Image

from service.workers.estimate import run_estimate
from tests.browser.camera.conftest import URL
from tests.browser.conftest import axe, finger, shoot, too_wide
from tests.conftest import CAMERA
from tests.running import served
from tests.service.street import LENS, PRIOR, Street

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated):
    with served(tmp_path_factory.mktemp("camera"), migrated, snapshots="pictures") as running:
        yield running


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
    page.get_by_role("button", name="Confirm this pose").click()
    page.get_by_role("button", name="Confirm", exact=True).click()
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
    assert after["items"][0]["residual_sd"] < 2
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
    phone = browser.new_context(has_touch=True, base_url=server.url).new_page()
    phone.goto(URL)
    phone.select_option("#hint-kind", "horizon")
    svg = phone.locator("[data-part=picture] svg.picture")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    shares = ((0.2, 0.1), (0.5, 0.1), (0.8, 0.1))
    finger(phone, *((box["x"] + u * box["width"], box["y"] + v * box["height"]) for u, v in shares))
    expect(phone.locator("polyline.mark.new")).to_have_count(1)
    u, v = map(float, phone.locator("#hint-to").input_value().split())
    assert u == pytest.approx(0.8 * LENS.width, abs=4)
    assert v == pytest.approx(0.1 * LENS.height, abs=4)
    phone.context.close()


# A plan of 60 x 45 m whose right is north: the camera is 20 m right of and 15 m up from its lower
# left corner, so 15 m to the west and 20 m to the north of it.
PLAN_M_PER_PX, AT = 0.05, (-15.0, 20.0)


def on_plan(page, forward_m, right_m):
    """Where a place of the street is on the plan, on the screen."""
    sine, cosine = math.sin(PRIOR.heading_rad), math.cos(PRIOR.heading_rad)
    east, north = forward_m * sine + right_m * cosine, forward_m * cosine - right_m * sine
    svg = page.locator("#site-plan")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    return (
        box["x"] + (AT[1] + north) / 60 * box["width"],
        box["y"] + (45 + AT[0] + east) / 45 * box["height"],
    )


@pytest.fixture
def planned(waiting, tmp_path, expect):
    """The page with a plan, measured by a line of 400 pixels that is 20 m long."""
    Image.linear_gradient("L").resize((1200, 900)).save(tmp_path / "plan.png")
    waiting.select_option("#hint-kind", "map_point")
    waiting.set_input_files("#plan-file", tmp_path / "plan.png")
    expect(waiting.locator("#plan-form")).to_be_visible()
    box = waiting.locator("#site-plan").bounding_box()
    waiting.mouse.move(box["x"] + box["width"] / 6, box["y"] + box["height"] / 2)
    waiting.mouse.down()
    waiting.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, steps=3)
    waiting.mouse.up()
    waiting.fill("#plan-length", "20")
    assert float(waiting.input_value("#plan-scale")) == pytest.approx(PLAN_M_PER_PX, rel=0.01)
    shoot(waiting, "plan-measured")
    waiting.fill("#plan-scale", str(PLAN_M_PER_PX))
    waiting.fill("#plan-north", "90")
    waiting.get_by_role("button", name="Keep the plan").click()
    expect(waiting.locator("#plan-form")).to_be_hidden()
    return waiting


def test_places_pointed_at_in_picture_and_plan_tell_where_it_stands(planned, server, expect):
    page = planned
    before = server.http.get("/cameras/corner/hints").json()["proposed"]["sd"]
    for number, place in enumerate([(12, -3), (14, 5), (18, 1)], start=1):
        page.mouse.click(*on_screen(page, *place))
        # A mouse may be dragged to its place.
        u, v = on_plan(page, *place)
        page.mouse.move(u - 30, v + 20)
        page.mouse.down()
        page.mouse.move(u, v, steps=3)
        page.mouse.up()
        page.get_by_role("button", name="Add the mark").click()
        expect(page.locator("#hint-list li")).to_have_count(number)
    expect(page.locator("#site-plan .mark")).to_have_count(3)
    expect(page.locator("[data-part=proposed]")).to_contain_text("Pan")
    shoot(page, "plan")
    after = server.http.get("/cameras/corner/hints").json()
    assert after["proposed"]["sd"]["height_m"] < before["height_m"] / 2
    assert before["heading_deg"] is None
    pose = after["proposed"]["pose"]
    assert (pose["x_m"], pose["y_m"]) == pytest.approx(AT, abs=0.7)
    assert pose["heading_deg"] == pytest.approx(40, abs=2)
    assert max(each["residual_sd"] for each in after["items"]) < 3
    assert axe(page) == []
    assert not too_wide(page)
    page.set_viewport_size({"width": 390, "height": 844})
    assert axe(page) == []
    assert not too_wide(page)
    shoot(page, "plan-phone")
    page.reload()
    page.select_option("#hint-kind", "map_point")
    expect(page.locator("#site-plan .mark")).to_have_count(3)
    page.get_by_role("button", name="Delete the plan").click()
    page.get_by_role("button", name="Delete it", exact=True).click()
    expect(page.locator("#site-plan")).to_be_hidden()
    assert server.http.get("/cameras/corner/plan").status_code == 404
    assert len(server.http.get("/cameras/corner/hints").json()["items"]) == 3


def test_a_finger_and_arrows_point_at_the_plan(planned, browser, server, expect):
    phone = browser.new_context(
        has_touch=True, base_url=server.url, viewport={"width": 390, "height": 844}
    ).new_page()
    phone.goto(URL)
    phone.select_option("#hint-kind", "map_point")
    finger(phone, on_screen(phone, 12, -3))
    u, v = on_plan(phone, 12, -3)
    finger(phone, (u + 20, v), (u + 10, v), (u, v))
    sine, cosine = math.sin(PRIOR.heading_rad), math.cos(PRIOR.heading_rad)
    x_m, y_m = AT[0] + 12 * sine - 3 * cosine, AT[1] + 12 * cosine + 3 * sine
    assert float(phone.input_value("#hint-x")) == pytest.approx(x_m, abs=0.2)
    assert float(phone.input_value("#hint-y")) == pytest.approx(y_m, abs=0.2)
    phone.context.close()
    # From the middle, 30 m right and 22.5 m up: 6 pixels an arrow, and one with Shift.
    planned.locator("#site-plan").focus()
    for press in ("ArrowRight", "ArrowRight", "ArrowUp", "Shift+ArrowLeft"):
        planned.keyboard.press(press)
    assert float(planned.input_value("#hint-x")) == pytest.approx(-22.5 - 6 * 0.05, abs=0.03)
    assert float(planned.input_value("#hint-y")) == pytest.approx(30 + 11 * 0.05, abs=0.03)
