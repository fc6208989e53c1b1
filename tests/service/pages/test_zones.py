"""Zones on a camera's page: over the grid, in a line each, and as downloads."""

import html
import re

import numpy as np

from models.quantiles import Z90
from service.enums import ZoneOn
from service.pages.drawings.zones import zone_parts
from service.wording.zones import corner_words, undetermined_words, zone_words
from tests.service.bench import PRIOR, moved

URL = "/ui/cameras/corner"
NASTY = "<gate & co>"
ZONES = [
    {"id": NASTY, "points": [[400, 350], [800, 361], [900, 600], [380, 560]]},
    {"id": "line", "points": [[300, 500], [900, 520]]},
    {"id": "sign", "on": "scene", "points": [[100, 100], [300, 100], [300, 300]]},
]


def draw(http):
    put = http.put("/cameras/corner/zones", json={"zones": ZONES}, headers={"If-Match": "*"})
    put.raise_for_status()


def section(text, name):
    return html.unescape(re.search(rf'data-part="{name}">(.*?)</section>', text, re.S)[1])


def test_without_zones_it_is_said_how_they_come(corner):
    text = corner.get(URL).text
    assert "PUT /cameras/corner/zones" in section(text, "zones")
    assert 'class="zone' not in text


def test_zones_of_a_camera_that_stands_are_drawn_once(bench):
    draw(bench.http)
    bench.see(PRIOR)
    text = bench.http.get(URL).text
    assert text.count('class="zone now"') == 3
    assert 'class="zone drawn"' not in text
    said = section(text, "zones")
    assert "No move of the camera is known since." in said
    for kind in ("frigate", "axis", "geojson"):
        link = re.search(rf'href="([^"]*format={kind})" download', said)[1]
        assert bench.http.get(link).status_code == 200


def test_zones_of_a_camera_that_moved_are_drawn_twice_and_said_on_page_and_alert(bench):
    draw(bench.http)
    bench.see(moved(tilt_deg=4), change=5)
    text = bench.http.get(URL).text
    assert text.count('class="zone drawn"') == text.count('class="zone now"') == 3
    shares = {
        z["id"]: z["overlap"] for z in bench.http.get("/cameras/corner/zones").json()["zones"]
    }
    words = f"{100 * shares[NASTY]:.0f} % on the ground still lies where it was drawn"
    assert 0.05 < shares[NASTY] < 0.95
    for part in (section(text, "zones"), section(text, "alerts")):
        assert f"<strong>{NASTY}</strong>: {words}" in part
        assert "line" in part
    assert NASTY not in text  # as it came


def test_page_of_a_moved_camera_names_what_zones_do_not_follow(bench):
    draw(bench.http)
    bench.see(moved(tilt_deg=4), change=5)  # no paths: the heading is open
    words = section(bench.http.get(URL).text, "zones")
    assert (
        "The tracks do not determine pan: if that changed too, the zones do not follow it and are "
        "off by up to the ± of each." in words
    )
    zones = bench.http.get("/cameras/corner/zones").json()["zones"]
    worst_px = max(major for major, _, _ in zones[0]["sd_px"])
    assert worst_px > 50
    assert f"corners within ±{Z90 * worst_px:.0f} px (90 %)" in words


def test_page_names_no_open_parameter_if_paths_determine_the_heading(bench):
    draw(bench.http)
    bench.see(moved(tilt_deg=4), change=5, paths=True)
    assert "do not determine" not in section(bench.http.get(URL).text, "zones")


def test_what_zones_do_not_follow_in_words():
    assert undetermined_words(("tilt", "roll", "height", "heading")) == ""
    assert "do not determine pan and roll: if" in undetermined_words(("tilt", "height"))
    assert "the tracks do not determine its new pose" in undetermined_words(())


def test_a_zone_in_words():
    def say(overlap, in_view=1.0, on=ZoneOn.GROUND):
        return zone_words(on, overlap=overlap, in_view=in_view)

    assert say(1.0) == "all still lies where it was drawn"
    assert say(0.001) == "nothing lies where it was drawn"
    assert say(0.5, 0.8) == (
        "50 % on the ground still lies where it was drawn, 20 % has left the picture"
    )
    assert say(0.5, on=ZoneOn.SCENE) == "50 % of it still lies where it was drawn"
    assert corner_words(10.0) == "corners within ±16 px (90 %)"
    assert corner_words(None) == ""
    assert say(0.3, 0.0) == "none of it is in the picture any more"


def test_a_zone_is_cut_at_the_picture(lens):
    far = np.array([[-5e4, 100], [640, 100], [640, 300.0]])
    (path, name) = zone_parts(lens, [("a", far)], "now")
    numbers = [float(x) for x in re.findall(r"-?[\d.]+", re.search(r' d="([^"]*)"', path)[1])]
    assert min(numbers) >= -0.5
    assert max(numbers) <= 1279.5
    assert zone_parts(lens, [("a", far - 1e5), ("b", np.zeros((0, 2)))], "drawn") == []
