"""The pages of webhooks and health in a browser."""

import re

import pytest

from tests.browser.conftest import axe, shoot, too_wide

pytestmark = pytest.mark.slow


def test_a_webhook_is_added_tested_switched_off_and_removed(page, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    page.goto("/ui/webhooks")
    page.get_by_label("Address").fill("http://127.0.0.1:9/hook")
    page.get_by_label("Name").fill("on call")
    page.get_by_role("button", name="Add it").click()
    expect(page.locator("#url-error")).to_contain_text("127.0.0.1")
    assert page.get_by_label("Name").input_value() == "on call"
    # Nothing is sent: no worker runs.
    page.get_by_label("Address").fill("https://1.1.1.1/hook")
    page.get_by_role("button", name="Add it").click()
    expect(page.locator("#secret-text")).to_have_text(re.compile("^whsec_"))
    page.get_by_role("link", name="I have it").click()
    page.get_by_role("button", name="Send a test").click()
    expect(page.locator("section tbody tr").first).to_contain_text("test")
    assert axe(page) == []
    shoot(page, "webhooks")
    page.get_by_role("button", name="Switch it off").click()
    expect(page.locator("section.card").first).to_contain_text("Switched off")
    page.set_viewport_size({"width": 390, "height": 844})
    assert too_wide(page) <= 0
    page.get_by_role("button", name="Remove…").click()
    page.locator("#confirm-yes").click()
    page.get_by_text("Nobody is told by a webhook yet").wait_for()
    assert server.http.get("/webhooks").json()["items"] == []
    page.get_by_role("link", name="Health").click()
    page.get_by_text("No worker was ever heard of.").wait_for()
    expect(page.locator("#health")).to_contain_text("No worker runs")
    assert axe(page) == []
    shoot(page, "health")
