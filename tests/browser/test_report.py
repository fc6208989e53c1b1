"""The report in a browser, and on paper."""

import os

import pytest

from tests.browser.conftest import SHOTS, axe, shoot, too_wide
from tests.service.fleet_bench import Fleet
from tests.service.reports.rows import some_weeks

pytestmark = pytest.mark.slow


@pytest.mark.nightly
def test_it_is_read_on_a_screen_and_printed_without_what_is_pressed(page, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    some_weeks(fleet)
    fleet.add("quiet", "The quay", state="no_data")
    fleet.add("new", "New one", state="unconnected", tracks=0)
    fleet.close()
    page.goto("/ui/alerts")
    page.get_by_role("link", name="Report").click()
    page.get_by_label("From").fill("2026-03-23")
    page.get_by_label("to", exact=True).fill("2026-03-30")
    page.get_by_role("button", name="Show").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Report, 23 Mar 2026 to 30 Mar 2026")
    expect(page.locator("main")).to_contain_text("put back by Ada after 3 hours")
    assert axe(page) == []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        for width in (390, 1280):
            page.set_viewport_size({"width": width, "height": 844})
            assert too_wide(page) <= 0, width
            shoot(page, f"report-{width}-{scheme}")
    page.emulate_media(media="print", color_scheme="dark")
    for what in (".top", ".days", ".head .buttons"):
        expect(page.locator(what)).to_be_hidden()
    ink = page.evaluate("getComputedStyle(document.body).color")
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (ink, paper) == ("rgb(0, 0, 0)", "rgb(255, 255, 255)")
    shoot(page, "report-print")
    if SHOTS:
        page.pdf(path=os.path.join(SHOTS, "report.pdf"), format="A4")


def test_a_shift_is_handed_over_and_taken_over_by_a_click(page, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(3):
        fleet.add(f"c{n}", f"Corner {n}", tilt_deg=3.0)
        fleet.knock(f"c{n}", by="Ada" if n else None)
    fleet.close()
    page.goto("/ui/alerts")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_role("link", name="Handover").click()
    expect(page.get_by_role("heading", name="Still open")).to_have_text("Still open 3")
    page.get_by_label("To whoever comes next").fill("Gate 3 is being repaired: ask Cy.")
    assert axe(page) == []
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 844})
        assert too_wide(page) <= 0, width
        shoot(page, f"handover-{width}")
    page.get_by_role("button", name="Hand over").click()
    banner = page.get_by_role("group", name="Handover")
    expect(banner).to_contain_text("Handover by Ada: Gate 3 is being repaired: ask Cy.")
    assert axe(page) == []
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 844})
        shoot(page, f"handover-fleet-{width}")
    page.evaluate("localStorage.setItem('surefoot.by', 'Bo')")
    banner.get_by_role("button", name="Take over").click()
    expect(banner).to_have_count(0)
    expect(page.locator("#announce")).to_have_text("Taken over.")
    (kept,) = server.http.get("/handovers").json()["items"]
    assert (kept["by"], kept["taken_by"]) == ("Ada", "Bo")
