"""Pages in German in a browser that asks for it: what scripts say, too, and nothing too wide."""

import re

import pytest
from fastapi.routing import APIRoute

from service.app import create_app
from tests.browser.conftest import axe, shoot, too_wide, watched
from tests.service.fleet_bench import Fleet

pytestmark = pytest.mark.slow
SEEN_APART = {"alerts", "wall", "login"}


def pages_of(settings):
    """The names of all pages that are of no single camera, but for those that are seen apart."""
    routes = (route for route in create_app(settings).routes if isinstance(route, APIRoute))
    paths = (route.path for route in routes if "GET" in route.methods)
    found = {path.removeprefix("/ui/") for path in paths if re.fullmatch("/ui/[a-z]+", path)}
    return sorted(found - SEEN_APART)


@pytest.fixture
def page(browser, server):
    with watched(browser, server, locale="de-DE") as (made, wrong):
        yield made
    assert wrong == []


def looked_at(page, name):
    """Is a page sound, and as wide as its window, on a desktop and a phone?"""
    assert axe(page) == []
    assert page.evaluate("document.documentElement.lang") == "de"
    for width, height in ((1280, 800), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        assert too_wide(page) <= 0, name
        shoot(page, f"german-{name}-{width}")
    page.set_viewport_size({"width": 1280, "height": 800})


def test_an_operator_reads_german_and_may_read_english(page, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    fleet = Fleet(server.settings)
    for n in range(5):
        fleet.add(f"c{n}", f"Ecke {n}", tilt_deg=3.0)
    fleet.knock("c0")
    fleet.knock("c1", kind="clock", severity="warning")
    fleet.add("neu", "Neue Kamera", "learning", tracks=12)
    page.goto("/")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    expect(page.locator("#live")).to_have_text("Live")
    expect(page).to_have_title("(2) Kameras · surefoot")
    row = page.locator("#row-c0")
    expect(row).to_contain_text("Verstellt")
    expect(row).to_contain_text("um 3,1° gedreht (")
    expect(row).to_contain_text("13 cm tiefer")
    page.get_by_label("Ecke 0 wählen").check()
    expect(page.locator("#chosen")).to_have_text("1 Kamera")
    looked_at(page, "fleet")
    page.locator("#search").fill("verstellt")  # by its state, as it is called here
    expect(page.locator("li.row")).to_have_count(1)
    page.goto("/ui/alerts")
    looked_at(page, "alerts")
    page.get_by_role("button", name="Quittieren").first.click()
    expect(page.locator("#announce")).to_have_text("Quittiert.")
    expect(page.locator(".flag").first).to_have_text("quittiert von Ada")
    page.goto("/ui/wall")
    expect(page.get_by_role("heading")).to_contain_text("1 offen · 1 in Bearbeitung · 6 Kameras")
    expect(page.locator("#age")).to_have_text(re.compile(r"Stand \d\d:\d\d:\d\d, vor \d+ s"))
    looked_at(page, "wall")
    page.goto("/ui/cameras/c0")
    expect(page.locator(".headline")).to_contain_text("Die Kamera ist verstellt: um 3,")
    looked_at(page, "camera")
    page.get_by_role("button", name="Neue Ausrichtung behalten").click()
    expect(page.locator(".undo")).to_have_text(
        re.compile(r"Eigene Antwort, gerade eben: neue Ausrichtung behalten\. Rückgängig")
    )
    pages = pages_of(server.settings)
    assert {"handover", "settings", "tokens"} <= set(pages)
    for name in pages:
        page.goto(f"/ui/{name}")
        looked_at(page, name)
    page.goto("/ui/cameras/neu")
    expect(page.locator("#posts")).to_contain_text("12 von 200 Personen")
    looked_at(page, "connect")
    page.goto("/")
    for n in (2, 3):
        page.get_by_label(f"Ecke {n} wählen").check()
    expect(page.locator("#chosen")).to_have_text("2 Kameras")
    page.get_by_label("Ecke 1 wählen").check()
    expect(page.locator("#mixed")).to_have_text(
        "Nicht jede Antwort passt zu allen: 1 von 3 mit falscher Uhr (Ecke 1)."
    )
    page.get_by_label("Ecke 1 wählen").uncheck()
    page.get_by_role("button", name="Mit alter Ausrichtung neu lernen").click()
    expect(page.locator("#undo span")).to_have_text("Wird neu gelernt: 2 Kameras.")
    expect(page.locator("#undo").get_by_role("button", name="Rückgängig")).to_be_visible()
    page.goto("/ui/cameras/neu")
    page.get_by_role("button", name="English").click()
    expect(page.locator(".headline")).to_contain_text("Learning: 12 of 200 people")
    page.goto("/")
    expect(page.locator("h1")).to_have_text("Cameras")
    page.get_by_role("button", name="Deutsch").click()
    expect(page.locator("h1")).to_have_text("Kameras")
    fleet.close()
