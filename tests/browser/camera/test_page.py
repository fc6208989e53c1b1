"""The page of a camera in a real browser: what it says, and that it stays live."""

import contextlib
import math
import re

import pytest
from PIL import Image

from service.access.activity import note
from service.enums import Activity
from service.store.engines.store import Store
from service.workers.estimate import compare_if_due
from tests.browser.camera.conftest import URL
from tests.browser.conftest import axe, shoot, too_wide
from tests.conftest import CAMERA
from tests.models.pictures.given import seen_after, wall
from tests.running import served
from tests.service.bench import PRIOR, Bench, moved
from tests.service.street import KNOCKED, LENS, Street
from tests.service.street import PRIOR as STREET_PRIOR

pytestmark = pytest.mark.slow


def test_a_knock_arrives_without_a_reload(page, bench):
    expect = pytest.importorskip("playwright.sync_api").expect
    bench.see(PRIOR, paths=True)
    page.goto(URL)
    expect(page.locator(".headline")).to_contain_text("Standing where it should")
    expect(page.locator("#live")).to_have_attribute("data-state", "on")
    page.evaluate("window.untouched = true")
    page.locator("#charts-table summary").click()
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0, heading_deg=-3.0), paths=True)
    expect(page.get_by_role("heading", name="The camera moved")).to_be_visible()
    expect(page.locator(".headline")).to_contain_text("turned 5.8° (pan −3.0°, tilt +5.0°)")
    expect(page.locator(".picture path.grid.served")).to_have_count(1)
    expect(page.locator("#announce")).to_contain_text("turned")
    expect(page).to_have_title(re.compile("^Moved: The corner"))
    expect(page.locator("#charts-values tbody tr")).to_have_count(4)
    assert page.evaluate("window.untouched")


def test_the_charts_are_of_as_many_days_as_are_asked_for(seen):
    expect = pytest.importorskip("playwright.sync_api").expect
    assert seen.locator("#charts svg").count() == 4
    assert seen.locator("#charts circle").count() == 4 * 5
    seen.get_by_role("link", name="24 hours").click()
    expect(seen.get_by_role("link", name="24 hours")).to_have_attribute("aria-current", "true")
    seen.locator("#charts-table summary").click()
    expect(seen.locator("#charts-values")).to_contain_text("26.99° ±0.36")
    # Where people walked then and now; a grid at a time, of whoever wants one.
    expect(seen.locator(".picture .track.then")).to_be_attached()
    expect(seen.locator(".picture .grid.served")).to_be_hidden()
    seen.get_by_label("Ground as it is").check()
    expect(seen.locator(".picture .grid.served")).to_be_visible()
    expect(seen.locator(".picture .grid.prior")).to_be_hidden()
    shoot(seen, "charts")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_sound(page, knocked, server, scheme):
    with contextlib.closing(Store(server.settings)) as store, store.write() as session:
        for _ in range(40):  # a log that is longer than its place
            note(session, Activity.CAMERA_CHANGED, by="Ada", camera_id="corner")
    page.emulate_media(color_scheme=scheme)
    page.goto(URL)
    page.wait_for_selector("#charts svg")
    assert axe(page) == []
    for dialog in ("name", "silence", "maintain"):
        page.evaluate(f"document.getElementById('{dialog}-dialog').showModal()")
        assert axe(page) == [], dialog
        page.keyboard.press("Escape")
    for width in (360, 2560):
        page.set_viewport_size({"width": width, "height": 800})
        assert too_wide(page) <= 0, width
        assert axe(page) == [], width


@pytest.mark.nightly
def test_a_still_image_is_put_behind_the_drawing_and_taken_away(browser, tmp_path, migrated):
    expect = pytest.importorskip("playwright.sync_api").expect
    Image.linear_gradient("L").resize((1280, 720)).save(tmp_path / "still.png")
    Image.new("L", (720, 1280)).save(tmp_path / "upright.png")
    with served(tmp_path, migrated, snapshots="pictures", window_tracks=20) as server:
        server.http.post("/cameras", json=CAMERA).raise_for_status()
        bench = Bench(server.http, server.settings)
        street, grey = Street(server.http, server.settings), wall(lens=LENS)

        def see(pose):
            Image.fromarray(seen_after(grey, STREET_PRIOR, pose, LENS)).save(tmp_path / "seen.png")
            content, how = (tmp_path / "seen.png").read_bytes(), {"Content-Type": "image/png"}
            server.http.put(f"{URL[3:]}/snapshot", content=content, headers=how).raise_for_status()
            compare_if_due(street.context, "corner")

        see(STREET_PRIOR)
        for _ in range(3):
            bench.see(moved(tilt_deg=5.0))
        page = browser.new_context(base_url=server.url).new_page()
        page.goto(URL)
        page.locator("#still-file").set_input_files(tmp_path / "upright.png")
        expect(page.locator("#problem-detail")).to_contain_text("1280 x 720")
        page.keyboard.press("Escape")
        page.locator("#still-file").set_input_files(tmp_path / "still.png")
        expect(page.locator(".picture image")).to_have_count(1)
        assert axe(page) == []
        shoot(page, "camera-still-image")
        # Before and now lie over one another, once it was seen to stand and then to have moved.
        see(KNOCKED)
        page.reload()
        expect(page.locator(".stills img")).to_have_count(2, timeout=30_000)
        slider = page.get_by_label("How much of the picture before is shown")
        slider.fill("20")
        assert page.locator(".stills").get_attribute("style") == "--shown: 20%;"
        assert axe(page) == []
        shoot(page, "camera-before-and-now")
        page.get_by_role("link", name="Aim it live").first.click()
        expect(page.locator("#aim-words")).to_have_text("5.0° up")
        page.set_viewport_size({"width": 390, "height": 844})
        assert axe(page) == []
        shoot(page, "camera-aim")
        page.go_back()
        page.set_viewport_size({"width": 1280, "height": 720})
        page.get_by_role("button", name="Remove it").click()
        expect(page.locator(".picture image")).to_have_count(0)
        assert server.http.get("/cameras/corner/snapshot").status_code == 404
        page.context.close()  # a service that stops waits 3 s for streams of events


def test_a_knocked_street_is_seen_to_be_knocked(page, server, empty):
    """The whole way, with the real estimator: the two grids part, the page says how far."""
    expect = pytest.importorskip("playwright.sync_api").expect
    server.http.post("/cameras", json={**CAMERA, "reference_tracks": 150}).raise_for_status()
    street = Street(server.http, server.settings.model_copy(update={"window_tracks": 100}))
    page.goto(URL)
    expect(page.locator(".headline")).to_contain_text("Nobody has posted")
    shoot(page, "camera-new")
    street.keep_to_lanes(STREET_PRIOR, 150)
    street.look()
    for _ in range(4):
        street.keep_to_lanes(STREET_PRIOR, 25)
        street.look()
    expect(page.locator(".headline")).to_contain_text("Standing where it should", timeout=30_000)
    expect(page.locator("#charts circle").nth(15)).to_be_attached()
    shoot(page, "camera-still")
    for _ in range(4):
        street.keep_to_lanes(KNOCKED, 15)
        street.look()
    expect(page.get_by_role("heading", name="The camera moved")).to_be_visible(timeout=30_000)
    expect(page.locator(".headline")).to_contain_text("turned", timeout=30_000)
    page.evaluate("document.getElementById('announce').textContent = ''")
    told = page.locator(".headline").inner_text()
    angle = float(re.search(r"turned (\d+\.\d)°", told)[1])
    assert angle == pytest.approx(math.hypot(5, 4), abs=1.0), told
    expect(page.locator(".meaning")).to_contain_text("A person at 10 m is now placed")
    shoot(page, "camera-knocked")
    page.emulate_media(color_scheme="dark")
    shoot(page, "camera-knocked-dark")
    page.set_viewport_size({"width": 390, "height": 844})
    shoot(page, "camera-phone-dark")
    page.emulate_media(color_scheme="light")
    shoot(page, "camera-phone")
