"""Zones on a camera's page, in a browser: to be seen, to be read, to be downloaded."""

import pytest

from tests.browser.camera.conftest import URL
from tests.browser.conftest import SHOTS, axe
from tests.service.bench import moved

pytestmark = pytest.mark.slow

ZONES = [
    {"id": "gate", "points": [[400, 380], [800, 371], [900, 600], [380, 560]]},
    {"id": "line", "points": [[420, 560], [620, 500]]},
    {"id": "pavement", "points": [[20, 420], [280, 330], [330, 420], [30, 640]]},
    {"id": "sign", "on": "scene", "points": [[1000, 100], [1100, 100], [1100, 180], [1000, 180]]},
]


def draw(bench):
    drawn = bench.http.put(
        "/cameras/corner/zones", json={"zones": ZONES}, headers={"If-Match": "*"}
    )
    drawn.raise_for_status()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_zones_of_a_knocked_camera_are_seen_said_and_downloaded(page, bench, scheme):
    draw(bench)
    page.emulate_media(color_scheme=scheme)
    page.goto(URL)
    assert page.locator(".zone.now").count() == 4
    assert page.locator(".zone.drawn").count() == 0
    for _ in range(2):
        bench.see(moved(tilt_deg=4, heading_deg=-3), change=5, paths=True)
    page.goto(URL)
    page.wait_for_selector("#charts svg")
    assert page.locator(".zone.drawn").count() == 4
    assert "still lies where it was drawn" in page.locator(".zones-meant").inner_text()
    missed = "of the last 15 who crossed it, all were missed"
    line = page.locator(".zones-meant li").first.inner_text()
    assert line == f"line: nothing lies where it was drawn; {missed}"
    if SHOTS:
        page.screenshot(path=f"{SHOTS}/zones-{scheme}.png", full_page=True)
    assert axe(page) == []
    with page.expect_download() as download:
        page.get_by_role("link", name="Frigate").click()
    assert download.value.suggested_filename == "corner-zones.yml"
    page.set_viewport_size({"width": 390, "height": 800})
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= 390
    if SHOTS:
        page.screenshot(path=f"{SHOTS}/zones-{scheme}-narrow.png", full_page=True)
