"""The page of all alerts in a browser: twelve answered by three clicks, one in its line."""

import pytest

from tests.browser.conftest import axe, shoot, too_wide
from tests.service.fleet_bench import Fleet

pytestmark = pytest.mark.slow
# Clicks once more at a place, as soon as a row has gone.
AGAIN = """([clientX, clientY]) => new MutationObserver((_, watch) => {
  if (document.querySelectorAll(".alert-row").length !== 1) return;
  watch.disconnect();
  const button = document.elementFromPoint(clientX, clientY);
  window.under = button.textContent;
  button.dispatchEvent(new MouseEvent("click", { bubbles: true, detail: 1, clientX, clientY }));
}).observe(document.body, { childList: true, subtree: true })"""


def test_twelve_cameras_take_three_clicks_and_it_stays_live(page, server):
    """They took 48 to 60, on twelve pages."""
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(12):
        fleet.add(f"c{n:02}", f"Corner {n}", tilt_deg=3.0)
        fleet.knock(f"c{n:02}")
    fleet.add("clock")
    page.goto("/")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_role("link", name="Alerts").click()
    page.get_by_text("Live").wait_for()
    fleet.knock("clock", kind="clock")
    expect(page.locator(".alert-row")).to_have_count(13)
    expect(page.locator("#announce")).to_have_text("A new alert: clock")
    page.get_by_label("All that are shown").check()
    expect(page.locator("#chosen")).to_have_text("13 alerts")
    put_back = page.get_by_role("button", name="They were put back")
    expect(put_back).to_be_hidden()  # of a clock nobody says that
    shoot(page, "alerts-chosen")
    page.get_by_label("Choose clock").uncheck()
    assert axe(page) == []
    for scheme in ("dark", "light"):
        page.emulate_media(color_scheme=scheme)
        for width in (390, 1280, 2560):
            page.set_viewport_size({"width": width, "height": 800})
            assert too_wide(page) <= 0, width
        shoot(page, f"alerts-{scheme}")
    page.set_viewport_size({"width": 390, "height": 844})
    shoot(page, "alerts-phone")
    put_back.click()
    expect(page.locator(".alert-row")).to_have_count(1)
    expect(page.locator("#bulk")).to_be_hidden()
    page.get_by_role("button", name="The clock is right again").click()
    expect(page.locator("#rows")).to_contain_text("No alert is like that")
    found = server.http.get("/alerts").json()["items"]
    assert {(a["outcome"], a["resolved_by"]) for a in found} == {
        ("put_back", "Ada"),
        ("mended", "Ada"),
    }
    fleet.close()


def test_a_second_click_at_one_place_answers_no_other_alert(page, server):
    """The next row's button comes to lie under the pointer as soon as the first one's row goes."""
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for camera_id in ("first", "second"):
        fleet.add(camera_id, tilt_deg=3.0)
        fleet.knock(camera_id)
    fleet.close()
    page.goto("/ui/alerts")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    rows = page.locator(".alert-row")
    box = rows.first.get_by_role("button", name="It did not move").bounding_box()
    at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.evaluate(AGAIN, at)
    page.mouse.click(*at)
    expect(rows).to_have_count(1)
    assert page.evaluate("window.under").strip() == "It did not move"
    page.wait_for_timeout(500)
    found = server.http.get("/alerts").json()["items"]
    assert sorted(a["outcome"] or "" for a in found) == ["", "false_alarm"]
    # A while later it is meant.
    page.wait_for_timeout(1000)
    page.mouse.click(*at)
    expect(page.locator("#rows")).to_contain_text("No alert is like that")
