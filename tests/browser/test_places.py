"""Sites and tags on the fleet page in a browser."""

import pytest

from tests.browser.conftest import axe, shoot, too_wide
from tests.browser.test_fleet import shown
from tests.service.fleet_bench import Fleet

pytestmark = pytest.mark.slow


@pytest.fixture
def fleet(server):
    made = Fleet(server.settings)
    yield made
    made.close()


def test_sites_and_tags_sift_by_chips_and_many_are_tagged(page, fleet, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet.add("gate", "Gate", site="campus/north", tags=("outdoor", "ptz"))
    fleet.add("hall", "Hall", site="campus/south", tags=("indoor",))
    fleet.add("yard", "Yard", site="campus/north/yard", tags=("outdoor",))
    fleet.add("quay", "Quay", site="harbour")
    fleet.knock("yard")
    page.goto("/")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_text("Live").wait_for()
    places = page.locator("#places")
    chip = lambda name: places.get_by_role("button", name=name)  # noqa: E731
    expect(chip("campus 3 1 needs a person")).to_be_visible()
    chip("campus 3").click()
    assert page.url.endswith("/?site=campus")
    expect(page.locator("li.row")).to_have_count(3)
    chip("north 2").focus()
    page.keyboard.press("Enter")  # the chip stays, and so does the focus
    expect(page.locator("#places :focus")).to_have_text("north")
    expect(page.locator("#places :focus")).to_have_attribute("aria-pressed", "true")
    assert page.locator(".chip.drifting b").inner_text() == "1"
    expect(page.locator("li.row")).to_have_count(2)
    chip("#ptz").click()
    expect(page.locator("li.row")).to_have_count(1)
    assert shown(page) == ["Gate"]
    assert page.url.endswith("/?site=campus%2Fnorth&tag=ptz")
    page.reload()
    expect(page.locator("li.row")).to_have_count(1)
    shoot(page, "fleet-site")
    chip("#ptz").click()
    chip("All sites").click()
    expect(page.locator("li.row")).to_have_count(4)
    page.locator("#search").fill("campus/north")
    expect(page.locator("li.row")).to_have_count(2)
    page.get_by_label("Choose all that are found").check()
    tag = page.get_by_role("button", name="Tag…")
    tag.click()
    page.get_by_role("button", name="Tag them").click()
    expect(page.locator("#tag-add-error")).to_have_text("A word is needed, here or below.")
    page.get_by_label("Add", exact=True).fill("night, out/door")
    page.keyboard.press("Enter")
    expect(page.locator("#tag-add-error")).to_contain_text("which 'out/door' is not")
    assert page.get_by_label("Add", exact=True).input_value() == "night, out/door"
    assert axe(page) == []
    shoot(page, "fleet-tag")
    page.keyboard.press("Escape")
    expect(tag).to_be_focused()
    page.keyboard.press("Enter")
    page.get_by_label("Add", exact=True).fill("night")
    page.get_by_label("Take away").fill("ptz")
    page.keyboard.press("Enter")
    expect(page.locator("#row-gate .id")).to_contain_text("#night #outdoor")
    expect(chip("#night")).to_contain_text("2")
    tags = {i: server.http.get(f"/cameras/{i}").json()["tags"] for i in ("gate", "yard", "hall")}
    assert tags == {"gate": ["night", "outdoor"], "yard": ["night", "outdoor"], "hall": ["indoor"]}
    page.set_viewport_size({"width": 390, "height": 844})
    assert too_wide(page) <= 0
    assert axe(page) == []
    shoot(page, "fleet-site-phone")
