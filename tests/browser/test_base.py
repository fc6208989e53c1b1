"""What every page has: reachable without a mouse, its own host only, no broken contrast."""

import pytest

from tests.browser.conftest import axe, too_wide
from tests.running import served

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated):
    with served(tmp_path_factory.mktemp("base"), migrated) as running:
        yield running


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_an_empty_fleet_is_sound(page, scheme):
    page.emulate_media(color_scheme=scheme)
    page.goto("/")
    assert axe(page) == []
    page.set_viewport_size({"width": 360, "height": 700})
    assert too_wide(page) <= 0


def test_the_first_stop_of_the_keyboard_skips_the_head(page):
    page.goto("/ui/health")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
