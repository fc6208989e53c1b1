"""The page of all alerts in a browser: twelve answered by three clicks, one in its line."""

from datetime import UTC, datetime

import pytest
from sqlalchemy import select

from service.store import references
from service.store.alerts import AlertRecord
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
    for button in page.locator("#bulk [data-bulk]").all():
        assert button.get_attribute("title").endswith(".")  # what it comes to
    expect(page.locator("#mixed")).to_have_text(
        "Not every answer fits all: 1 of 13 is a clock fault (clock)."
    )
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
    expect(page.locator("#undo")).to_contain_text("Put back: 12 cameras.")
    shoot(page, "alerts-undo-phone")
    page.get_by_role("button", name="Fixed", exact=True).click()
    expect(page.locator("#rows")).to_contain_text("No alert is like that")
    found = server.http.get("/alerts").json()["items"]
    assert {(a["outcome"], a["resolved_by"]) for a in found} == {
        ("put_back", "Ada"),
        ("fixed", "Ada"),
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
    page.get_by_text("No worker runs").wait_for()  # it comes late, and moves the rows
    rows = page.locator(".alert-row")
    box = rows.first.get_by_role("button", name="False alarm").bounding_box()
    at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.evaluate(AGAIN, at)
    page.mouse.click(*at)
    expect(rows).to_have_count(1)
    assert page.evaluate("window.under").strip() == "False alarm"
    page.wait_for_timeout(500)
    found = server.http.get("/alerts").json()["items"]
    assert sorted(a["outcome"] or "" for a in found) == ["", "false_alarm"]
    # A while later it is meant.
    page.wait_for_timeout(1000)
    page.mouse.click(*at)
    expect(page.locator("#rows")).to_contain_text("No alert is like that")


@pytest.mark.parametrize(
    ("path", "words"), [("/", "To the cameras"), ("/ui/alerts", "To the alerts")]
)
def test_a_keyboard_is_at_the_first_row_after_three_stops_and_never_lost(page, server, path, words):
    """It took 15; and whoever answered an alert began at the page's head again."""
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(3):
        fleet.add(f"c{n}", f"Corner {n}", tilt_deg=3.0)
        fleet.knock(f"c{n}")
    fleet.close()
    page.goto(path)
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_text("Live").wait_for()
    focused = page.locator(":focus")
    page.keyboard.press("Tab")
    expect(focused).to_have_text(words)
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    expect(focused).to_have_class("pick")
    row = page.locator("li.row, li.alert-row").first
    expect(row.locator(".pick")).to_be_focused()
    # A dialog that is called off gives the focus back.
    page.keyboard.press("Space")
    silence = page.locator("#bulk").get_by_role("button", name="Silence…")
    silence.focus()
    page.keyboard.press("Enter")
    expect(page.get_by_label("1 hour")).to_be_focused()
    page.keyboard.press("Escape")
    expect(silence).to_be_focused()
    page.locator("#bulk").get_by_role("button", name="They were put back").focus()
    page.keyboard.press("Enter")
    undo = page.locator("#undo").get_by_role("button", name="Undo")
    expect(undo).to_be_visible()
    expect(page.locator("#rows")).to_be_focused()
    undo.focus()
    page.keyboard.press("Enter")
    expect(page.locator("#announce")).to_contain_text("Undone")
    expect(page.locator("#rows")).to_be_focused()
    if path == "/":
        return
    # A row that was answered goes: the next one has the focus.
    expect(page.locator(".alert-row")).to_have_count(3)
    second = page.locator(".alert-row").nth(1).get_attribute("id")
    page.locator(".alert-row").first.get_by_role("button", name="False alarm").focus()
    page.keyboard.press("Enter")
    expect(page.locator(".alert-row")).to_have_count(2)
    expect(page.locator(f"#{second} .pick")).to_be_focused()


def test_what_has_ended_offers_no_choice_of_all(page, server):
    """It was offered, and there was nothing to choose."""
    fleet = Fleet(server.settings)
    fleet.add("c0", tilt_deg=3.0)
    alert = fleet.knock("c0")
    fleet.close()
    page.goto("/ui/alerts")
    assert page.get_by_label("All that are shown").count() == 1
    server.http.post(f"/alerts/{alert}/resolve", json={"outcome": "put_back"}).raise_for_status()
    page.goto("/ui/alerts?state=resolved")
    assert page.locator(".alert-row").count() == 1
    assert page.get_by_label("All that are shown").count() == 0


def test_a_trackers_group_is_answered_once_for_all_and_undone(page, server):
    """It wore a clock's words, and each of its members had buttons of its own."""
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(3):
        fleet.add(f"c{n}", f"Corner {n}", tilt_deg=3.0)
    with fleet.store.write() as session:
        for n in range(3):
            references.newest(session, f"c{n}").source = "nvr-east"
    for n in range(3):
        fleet.knock(f"c{n}", drifted=["height"])  # as a wrong clock of the tracker makes it
    with fleet.store.write() as session:  # one was told of after the group
        last = session.scalars(select(AlertRecord).where(AlertRecord.camera_id == "c0")).one()
        last.opened_at = datetime.now(UTC)
    fleet.close()
    page.goto("/")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    banner = page.get_by_role("group", name="Alert about a tracker")
    expect(banner.get_by_role("button")).to_have_text(
        ["Fixed", "False alarm", "Acknowledge", "Silence…"]
    )
    expect(page.locator("#due")).to_have_text("1 needs a person, 3 cameras of nvr-east as one")
    page.get_by_label("Choose all that are found").check()
    expect(page.locator("#mixed")).to_have_text("3 of 3 are answered with their tracker.")
    expect(page.locator("#bulk").get_by_role("button", name="They were put back")).to_be_hidden()
    shoot(page, "group-fleet")
    page.get_by_role("link", name="Corner 1").first.click()
    apart = page.get_by_text("This camera apart")
    expect(page.get_by_role("button", name="It was put back")).to_be_hidden()
    apart.click()
    expect(page.get_by_role("button", name="It was put back")).to_be_visible()
    assert axe(page) == []
    shoot(page, "group-member")
    page.set_viewport_size({"width": 390, "height": 844})
    shoot(page, "group-member-phone")
    page.get_by_role("link", name="Cameras of a tracker moved together").click()
    rows = page.locator(".alert-row")
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("Many moved")
    shoot(page, "group-alert-phone")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto("/ui/alerts")
    expect(rows).to_have_count(4)
    # The one that speaks for them comes first, whichever is the newest.
    expect(rows.locator(".badge")).to_have_text(["Many moved", "Moved", "Moved", "Moved"])
    assert axe(page) == []
    shoot(page, "group-alerts")
    page.get_by_role("button", name="Fixed", exact=True).click()
    undo = page.locator("#undo")
    expect(undo).to_contain_text("Fixed: 3 cameras of nvr-east.")
    expect(rows).to_have_count(0)
    undo.get_by_role("button", name="Undo").click()
    expect(page.locator("#announce")).to_have_text("Undone: 3 cameras.")
    expect(rows).to_have_count(3)  # each by itself now: the group has ended
