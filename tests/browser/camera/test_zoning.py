"""Zones drawn by hand over the picture: by mouse, by finger, by keyboard."""

import pytest

from tests.browser.camera.conftest import URL
from tests.browser.camera.test_zones import ZONES, draw
from tests.browser.conftest import axe, finger, shoot, too_wide
from tests.service.bench import moved

pytestmark = pytest.mark.slow
PHONE = {"width": 390, "height": 844}


@pytest.fixture
def expect():
    return pytest.importorskip("playwright.sync_api").expect


def begin(page):
    page.goto(URL)
    page.get_by_role("button", name="Draw zones").click()


def spots(page, *points):
    """Where pixels of the camera's picture, 1280 wide, are on the screen."""
    page.locator("#over").evaluate("each => each.scrollIntoView({ block: 'center' })")
    box = page.locator("#over").bounding_box()
    scale = box["width"] / 1280
    return [(box["x"] + u * scale, box["y"] + v * scale) for u, v in points]


def save(page, expect):
    page.get_by_role("button", name="Save the zones").click()
    expect(page.locator("#zoning")).to_be_hidden()
    expect(page.get_by_role("button", name="Draw zones")).to_be_focused()


def kept(bench):
    answer = bench.http.get("/cameras/corner/zones").raise_for_status().json()
    return {each["id"]: each for each in answer["zones"]}, answer


def near(points, px=3):
    return [pytest.approx(point, abs=px) for point in points]


def test_a_mouse_draws_a_zone_and_mends_it(page, bench, expect):
    begin(page)
    page.get_by_role("button", name="New zone").click()
    for at in spots(page, (300, 400), (900, 400), (900, 650), (300, 650)):
        page.mouse.click(*at)
    expect(page.locator(".corner")).to_have_count(4)
    (first,) = spots(page, (300, 400))
    page.mouse.click(*first)  # that closes it: the dots between are there
    expect(page.locator(".between")).to_have_count(4)
    for way in [((900, 650), (1000, 600)), ((600, 400), (600, 350))]:
        (u, v), to = spots(page, *way)
        page.mouse.move(u, v)
        page.mouse.down()
        page.mouse.move(*to, steps=4)
        page.mouse.up()
    page.fill("#zoning-name", "pavement")
    shoot(page, "zoning")
    assert axe(page) == []
    save(page, expect)
    expect(page.locator("[data-part=zones]")).to_contain_text("pavement")
    expect(page.locator("[data-part=picture] .zone.now")).to_have_count(1)
    zones, _ = kept(bench)
    assert zones["pavement"]["on"] == "ground"
    drawn = [(300, 400), (600, 350), (900, 400), (1000, 600), (300, 650)]
    assert zones["pavement"]["points"] == near(drawn)
    entries = bench.http.get("/activity", params={"camera_id": "corner"}).json()["items"]
    assert [each["details"] for each in entries if each["what"] == "zones.drawn"] == [{"zones": 1}]


def test_a_keyboard_draws_a_line_and_a_zone(page, bench, expect):
    page.goto(URL)
    page.get_by_role("button", name="Draw zones").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_role("button", name="New zone")).to_be_focused()
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")  # a counting line: its first end is in the middle
    page.keyboard.press("Enter")
    expect(page.locator(".corner")).to_be_focused()
    for press in ["ArrowUp", "ArrowUp", "Shift+ArrowLeft", "Enter", "ArrowRight", "Enter"]:
        page.keyboard.press(press)
    expect(page.locator("#announce")).to_have_text("A line has two ends.")
    focused = page.locator(".corner:focus")
    expect(focused).to_have_attribute("aria-label", "Corner 2 of line 1, at 773 348")
    outline = focused.evaluate("each => getComputedStyle(each).strokeWidth")
    assert outline == "4px"
    shoot(page, "zoning-keyboard")
    page.get_by_role("button", name="New zone").focus()
    page.keyboard.press("Enter")
    for _ in range(4):
        page.keyboard.press("Enter")
    expect(page.locator(".corner")).to_have_count(4)
    page.keyboard.press("Delete")
    expect(page.locator(".corner")).to_have_count(3)
    page.keyboard.press("Tab")
    save(page, expect)
    zones, _ = kept(bench)
    assert zones["line 1"]["points"] == [[639, 348], [773, 348]]
    assert len(zones["zone 1"]["points"]) == 3
    # Escape leaves, and asks where something was changed.
    page.keyboard.press("Enter")
    expect(page.locator("#zoning")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator("#zoning")).to_be_hidden()
    page.keyboard.press("Enter")
    page.locator(".corner").first.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Escape")
    page.locator("#confirm-yes").click()
    expect(page.locator("#zoning")).to_be_hidden()
    assert kept(bench)[0]["line 1"]["points"] == [[639, 348], [773, 348]]


def test_a_finger_draws_a_mask_on_a_phone(browser, server, bench, expect):
    phone = browser.new_context(has_touch=True, base_url=server.url, viewport=PHONE).new_page()
    begin(phone)
    phone.get_by_role("button", name="New mask").tap()
    for at in spots(phone, (100, 100), (500, 100), (500, 300)):
        finger(phone, at)
    finger(phone, *spots(phone, (500, 300), (600, 350), (700, 400)))
    expect(phone.locator(".corner")).to_have_count(3)
    assert axe(phone) == []
    assert not too_wide(phone)
    shoot(phone, "zoning-phone")
    phone.get_by_role("button", name="Save the zones").tap()
    expect(phone.locator("#zoning")).to_be_hidden()
    (mask,) = kept(bench)[0].values()
    assert (mask["id"], mask["on"]) == ("mask 1", "scene")
    assert mask["points"] == near([(100, 100), (500, 100), (700, 400)], px=6)
    phone.context.close()


def test_of_a_camera_that_moved_zones_are_drawn_where_they_are_now(page, bench, expect):
    draw(bench)
    for _ in range(2):
        bench.see(moved(tilt_deg=4, heading_deg=-3), change=5, paths=True)
    before, answer = kept(bench)
    assert answer["moved"]
    begin(page)
    expect(page.locator("#over .zone")).to_have_count(4)
    page.select_option("#zoning-chosen", "line")
    expect(page.locator(".corner")).to_have_count(2)
    shoot(page, "zoning-moved")
    page.get_by_role("button", name="Remove it").click()
    save(page, expect)
    after, answer = kept(bench)
    assert not answer["moved"]
    assert after.keys() == {"gate", "pavement", "sign"}
    assert after["gate"]["points"] == near(before["gate"]["points_now"])
    assert after["sign"]["on"] == "scene"


def test_what_else_a_document_says_stays_and_what_is_frigates_is_not_drawn(page, bench, expect):
    ring = [[*point] for point in ZONES[0]["points"]]
    shape = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    feature = {
        "type": "Feature",
        "properties": {"name": "gate", "colour": "red"},
        "geometry": shape,
    }
    url, how = "/cameras/corner/zones", {"If-Match": "*"}
    document = {"type": "FeatureCollection", "features": [feature]}
    sent = bench.http.put(url, params={"format": "geojson"}, json=document, headers=how)
    sent.raise_for_status()
    begin(page)
    page.fill("#zoning-name", "north gate")
    # Somebody else draws meanwhile: nothing of theirs is lost.
    bench.http.put(url, params={"format": "geojson"}, json=document, headers=how)
    page.get_by_role("button", name="Save the zones").click()
    expect(page.locator("#zoning-says")).not_to_be_empty()
    page.get_by_role("button", name="Leave").click()
    page.locator("#confirm-yes").click()
    page.get_by_role("button", name="Draw zones").click()
    page.fill("#zoning-name", "north gate")
    save(page, expect)
    (now,) = bench.http.get(url, params={"format": "geojson"}).json()["features"]
    assert (now["id"], now["properties"]["colour"]) == ("north gate", "red")
    frigate = "zones: {gate: {coordinates: '0.1,0.5,0.6,0.5,0.6,0.9'}}"
    headers = {**how, "Content-Type": "application/yaml"}
    bench.http.put(url, content=frigate, headers=headers).raise_for_status()
    page.reload()
    expect(page.locator("[data-part=zones]")).to_contain_text("They came as Frigate has them")
    expect(page.get_by_role("button", name="Draw zones")).to_have_count(0)
