"""The wall in a browser: what needs a person, large, how old it is, and a sound."""

import re

import pytest

from tests.browser.conftest import axe, shoot, too_wide
from tests.running import wait_for
from tests.service.fleet_bench import Fleet

pytestmark = pytest.mark.slow


def test_a_wall_says_what_needs_a_person_and_that_it_stopped(page, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(14):
        fleet.add(f"c{n:02}", f"Station square {n}", tilt_deg=3.0)
    page.goto("/wall")
    expect(page).to_have_url(f"{server.url}/ui/wall")
    expect(page.get_by_role("heading")).to_have_text("Nothing needs a person · 14 cameras")
    for n in range(3):
        fleet.knock(f"c{n:02}")
    fleet.knock("c03", kind="clock", severity="warning")
    fleet.knock("c04", by="Ines")
    expect(page.locator("#wall li")).to_have_count(5)
    expect(page.get_by_role("heading")).to_contain_text("4 need a person · 1 looked after")
    expect(page).to_have_title("(4) Wall · surefoot")
    rows = page.locator("#wall li").all_text_contents()
    assert "Clock" in rows[3]  # a warning after what is critical, then what Ines looks after
    assert "acknowledged by Ines" in rows[4]
    assert re.fullmatch(r"As of \d\d:\d\d:\d\d, \d+ s ago", page.locator("#age").text_content())
    assert axe(page) == []
    for width, height in ((3840, 2160), (1920, 1080), (1280, 720), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        assert too_wide(page) <= 0, width
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            shoot(page, f"wall-{width}-{scheme}")
    page.set_viewport_size({"width": 3840, "height": 2160})
    # At once: the rows are made anew every few seconds.
    name = page.evaluate(
        "parseFloat(getComputedStyle(document.querySelector('#wall .who')).fontSize)"
    )
    assert name >= 70  # a 30th of the height of a 4K wall
    for n in range(5, 14):
        fleet.knock(f"c{n:02}")
    expect(page.get_by_text("and 6 more")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollHeight - innerHeight") <= 0
    shoot(page, "wall-full")
    expect(page.locator("#stopped")).to_be_hidden()
    server.stop()
    expect(page.locator("#stopped")).to_be_visible()
    expect(page.locator("#age")).to_contain_text("Stopped: as of")
    shoot(page, "wall-stopped")
    fleet.close()


SPY = """
window.tones = 0;
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (...when) {
  window.tones++;
  return start.apply(this, when);
};
"""


def test_a_sound_is_switched_on_and_told_apart_from_the_news_before(page, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(13):
        fleet.add(f"c{n}", tilt_deg=3.0)
    page.add_init_script(SPY)
    page.goto("/ui/wall")
    expect(page.locator("#age")).not_to_be_empty()
    fleet.knock("c0")
    expect(page.locator("#wall li")).to_have_count(1)
    assert page.evaluate("tones") == 0  # off until somebody wants it
    page.get_by_role("button", name="Sound: off").press("Enter")
    assert page.evaluate("tones") == 2  # so that one hears that it is on
    fleet.knock("c1")
    expect(page.locator("#wall li")).to_have_count(2)
    wait_for(lambda: page.evaluate("tones") == 4)
    for n in range(3, 12):
        fleet.knock(f"c{n}")
    expect(page.get_by_role("heading")).to_contain_text("11 need a person")
    heard = page.evaluate("tones")
    fleet.knock("c12", severity="warning")  # beyond the lines that are shown
    wait_for(lambda: page.evaluate("tones") == heard + 2)
    (first,) = server.http.get("/alerts?camera_id=c0").json()["items"]
    server.http.post(f"/alerts/{first['id']}/resolve", json={"outcome": "put_back"})
    expect(page.get_by_role("heading")).to_contain_text("11 need a person")
    assert page.evaluate("tones") == heard + 2  # what comes into sight is no news
    page.get_by_role("button", name="Sound: on").click()
    fleet.knock("c2")
    expect(page.get_by_role("heading")).to_contain_text("12 need a person")
    assert page.evaluate("tones") == heard + 2
    fleet.close()
