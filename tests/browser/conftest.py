"""A real service and a real browser: Debian's chromium, driven by playwright."""

import contextlib
import os
import shutil
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.running import RunningService, served

CHROMIUM = os.environ.get("SUREFOOT_TEST_CHROMIUM") or shutil.which("chromium")
# Where screenshots of the tests go, if anybody wants to look at them.
SHOTS = os.environ.get("SUREFOOT_TEST_SHOTS")
# Names that lead to this machine: as in a plain network, where browsers send no Sec-Fetch headers.
NAMES = "--host-resolver-rules=MAP *.test 127.0.0.1"


@pytest.fixture
def server(tmp_path: Path, migrated: Path) -> Iterator[RunningService]:
    """A server of one test; files whose tests leave nothing behind have one of their own."""
    with served(tmp_path, migrated) as running:
        yield running


@pytest.fixture(scope="package")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("there is no chromium on this machine (apt install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        # Containers run tests as root, where chromium's sandbox cannot be.
        args = ["--no-sandbox", NAMES]
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=args)
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: Any, server: RunningService) -> Iterator[Any]:
    """A page of 1280 x 800; the test fails where it asked another host or a script failed."""
    with watched(browser, server) as (made, wrong):
        yield made
    assert wrong == []


@contextlib.contextmanager
def watched(browser: Any, server: RunningService, **more: Any) -> Iterator[tuple[Any, list[str]]]:
    """A page of 1280 x 800, and the list into which goes what must not happen on it.

    `more` is what a context takes beside, its `locale` say.
    """
    size = {"width": 1280, "height": 800}
    context = browser.new_context(base_url=server.url, viewport=size, **more)
    made = context.new_page()
    made.set_default_timeout(15_000)
    wrong = no_foreign_requests(made, server.url)
    made.on("pageerror", lambda error: wrong.append(str(error)))
    made.on(
        "console",
        lambda message: "Content Security Policy" in message.text and wrong.append(message.text),
    )
    yield made, wrong
    context.close()


def no_foreign_requests(page: Any, url: str) -> list[str]:
    """The list into which goes every request to another host from now on."""
    foreign: list[str] = []

    def look(request: Any) -> None:
        asked = urlsplit(request.url)
        if asked.scheme not in ("data", "blob") and asked.netloc != urlsplit(url).netloc:
            foreign.append(request.url)

    page.on("request", look)
    return foreign


def axe(page: Any) -> list[str]:
    """What axe-core finds on a page that is serious or critical, a line each; empty is good."""
    page.evaluate(files("axe_playwright_python").joinpath("axe.min.js").read_text())
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{item['id']}: {node['target']} {node['failureSummary']}"
        for item in found["violations"]
        if item["impact"] in ("serious", "critical")
        for node in item["nodes"]
    ]


def finger(page: Any, *points: tuple[float, float]) -> None:
    """Press a finger on a page's screen, drag it from point to point, and lift it."""
    devtools = page.context.new_cdp_session(page)
    for number, (x, y) in enumerate(points):
        kind = "touchMove" if number else "touchStart"
        devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
    devtools.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def too_wide(page: Any) -> int:
    """By how many pixels a page is wider than its window."""
    wide: int = page.evaluate(
        "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    )
    return wide


def shoot(page: Any, name: str) -> None:
    """Keep a screenshot, if anybody wants to look at it."""
    if SHOTS:
        page.wait_for_timeout(800)  # whatever moves has come to rest
        page.screenshot(path=f"{SHOTS}/{name}.png", full_page=True)
