"""What is said of a camera is changed on its page, and the camera deleted; other pages follow."""

import pytest

from tests.browser.camera.conftest import URL
from tests.browser.conftest import axe, shoot, too_wide, watched

pytestmark = pytest.mark.slow


@pytest.fixture
def opened(page, bench):
    page.goto(URL)
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_text("Live", exact=True).wait_for()
    return page


@pytest.fixture
def expect():
    return pytest.importorskip("playwright.sync_api").expect


def test_it_is_renamed_by_mouse_and_what_is_refused_stays_typed(opened, bench, expect):
    button = opened.get_by_role("button", name="Edit…")
    button.click()
    name, site, tags = (opened.get_by_label(each, exact=True) for each in ("Name", "Site", "Tags"))
    expect(name).to_have_value("The corner")
    name.fill("Bus gate")
    site.fill("campus//north")
    tags.fill("outdoor, nvr-east")
    opened.get_by_role("button", name="Save").click()
    said = opened.locator("#edit-site-error")
    expect(said).to_have_text(
        "Names with / between them are needed, such as campus/north, and no #."
    )
    expect(site).to_be_focused()
    assert name.input_value() == "Bus gate"
    assert axe(opened) == []
    shoot(opened, "edit")
    site.fill("campus/north")
    tags.fill("out/door")
    opened.get_by_role("button", name="Save").click()
    expect(opened.locator("#edit-tags-error")).to_contain_text("which 'out/door' is not")
    expect(said).to_have_text("")
    tags.fill("outdoor, nvr-east")
    opened.get_by_role("button", name="Save").click()
    expect(opened.get_by_role("heading", name="Bus gate")).to_be_visible()
    expect(button).to_be_focused()
    expect(opened.locator("[data-part=head]")).to_contain_text("campus/north")
    expect(opened.locator(".log")).to_contain_text("Ada changed its name, site, tags")
    camera = bench.http.get("/cameras/corner").json()
    assert (camera["site"], camera["tags"]) == ("campus/north", ["nvr-east", "outdoor"])
    opened.get_by_role("link", name="#outdoor").click()
    opened.wait_for_url("**/?tag=outdoor")
    assert opened.locator("li.row .who a").all_text_contents() == ["Bus gate"]


def test_it_is_edited_by_keyboard_and_nobody_is_written_over_unseen(opened, bench, expect):
    button = opened.get_by_role("button", name="Edit…")
    button.focus()
    opened.keyboard.press("Enter")
    expect(opened.get_by_label("Name", exact=True)).to_be_focused()
    opened.keyboard.press("Escape")
    expect(button).to_be_focused()
    opened.keyboard.press("Enter")
    expect(opened.get_by_label("Name", exact=True)).to_be_focused()
    opened.keyboard.press("Control+a")
    opened.keyboard.type("Mine")
    other = {"name": "Theirs", "tags": ["ptz"]}
    bench.http.patch("/cameras/corner", json=other, headers={"If-Match": "*"}).raise_for_status()
    expect(opened.get_by_role("heading", name="Theirs")).to_be_attached()  # behind the dialog
    opened.keyboard.press("Enter")
    expect(opened.locator("#edit-dialog [role=alert]")).to_contain_text("Somebody changed it")
    assert bench.http.get("/cameras/corner").json()["name"] == "Theirs"
    opened.keyboard.press("Enter")
    expect(opened.get_by_role("heading", name="Mine")).to_be_visible()
    expect(button).to_be_focused()
    camera = bench.http.get("/cameras/corner").json()
    assert (camera["name"], camera["tags"]) == ("Mine", ["ptz"])  # what nobody here has changed


def test_it_is_deleted_by_typing_its_name_and_other_pages_say_so(
    opened, bench, expect, browser, server
):
    opened.set_viewport_size({"width": 390, "height": 844})
    opened.locator("#more > summary").click()
    button = opened.get_by_role("button", name="Delete this camera…")
    button.click()
    typed = opened.get_by_label("Type its name")
    expect(typed).to_be_focused()
    typed.fill("the corner")
    opened.keyboard.press("Enter")
    expect(opened.locator("#remove-error")).to_contain_text("The corner, is needed")
    expect(typed).to_have_value("the corner")
    assert axe(opened) == []
    assert too_wide(opened) <= 0
    shoot(opened, "delete-phone")
    opened.keyboard.press("Escape")
    expect(button).to_be_focused()
    opened.keyboard.press("Enter")
    typed.fill("The corner")
    with watched(browser, server) as (other, wrong):
        other.goto(URL)
        other.get_by_text("Live", exact=True).wait_for()
        opened.keyboard.press("Enter")
        opened.wait_for_url(server.url + "/")
        other.get_by_text("This camera was removed.").wait_for()
        assert other.title() == "Removed · surefoot"
        shoot(other, "removed")
        assert axe(other) == []
        wrong.clear()  # the browser says of the page's 404
    assert bench.http.get("/cameras/corner").status_code == 404
    entry = bench.http.get("/activity").json()["items"][-1]
    assert (entry["what"], entry["by"]) == ("camera.removed", "Ada")


def test_what_is_set_and_what_words_mean(opened):
    opened.get_by_role("link", name="Glossary").click()
    opened.get_by_role("heading", name="Position").wait_for()
    assert axe(opened) == []
    shoot(opened, "glossary")
    opened.get_by_role("link", name="Settings").click()
    opened.get_by_text("DRIFT_CERTAINTY").wait_for()
    assert axe(opened) == []
    shoot(opened, "settings")
    for url in ("/ui/glossary", "/ui/settings"):
        opened.goto(url)
        opened.set_viewport_size({"width": 390, "height": 844})
        assert too_wide(opened) <= 0
        shoot(opened, url[4:] + "-phone")
