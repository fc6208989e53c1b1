"""The report in a browser, and on paper."""

import os

import pytest

from tests.browser.conftest import SHOTS, axe, shoot, too_wide
from tests.service.fleet_bench import Fleet
from tests.service.reports.rows import some_weeks

pytestmark = pytest.mark.slow


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
