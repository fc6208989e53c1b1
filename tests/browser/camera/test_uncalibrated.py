"""A camera that nobody has calibrated: registered by its lens, its pose agreed to on its page."""

import re

import pytest

from service.workers.estimate import run_estimate
from tests.browser.camera.conftest import URL
from tests.browser.conftest import axe, shoot, too_wide
from tests.service.street import PRIOR, Street

pytestmark = pytest.mark.slow


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

    street = Street(server.http, server.settings)
    try:
        street.keep_to_lanes(PRIOR, 60)
        run_estimate(street.context, "corner")
    finally:
        street.close()
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
