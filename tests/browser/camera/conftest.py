"""A camera's page in one tab, before one service whose database is put back before each test."""

import contextlib
import sqlite3

import pytest

from service.data_dir import DATABASE
from tests.browser.conftest import watched
from tests.conftest import CAMERA
from tests.running import served
from tests.service.bench import Bench, moved

URL = "/ui/cameras/corner"


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated):
    with served(tmp_path_factory.mktemp("camera"), migrated) as running:
        yield running


@pytest.fixture(scope="module")
def tab(browser, server):
    with watched(browser, server) as made:
        yield made


@pytest.fixture
def page(tab, server):
    """The one tab of a file, as if it was new."""
    made, wrong = tab
    made.goto("/healthz")
    made.evaluate("localStorage.clear(); sessionStorage.clear()")
    made.emulate_media(color_scheme="light")
    made.set_viewport_size({"width": 1280, "height": 800})
    yield made
    made.goto("about:blank")
    said = wrong.copy()
    wrong.clear()
    assert said == []


@pytest.fixture(scope="module")
def databases(server, tmp_path_factory):
    """Where databases lie that the service can be put back to, by name."""
    folder = tmp_path_factory.mktemp("databases")
    copy_database(server.settings.data_dir / DATABASE, folder / "empty")
    return folder


def copy_database(source, target):
    """Make one database the same as another, which a service may have open."""
    with (
        contextlib.closing(sqlite3.connect(source)) as given,
        contextlib.closing(sqlite3.connect(target)) as made,
    ):
        given.backup(made)


@pytest.fixture
def empty(server, databases):
    """The service as if it was new, whatever tests before this one did there.

    To delete the camera would leave the log of what was done to it, which is for good.
    """
    copy_database(databases / "empty", server.settings.data_dir / DATABASE)


def new_bench(server):
    server.http.post("/cameras", json=CAMERA).raise_for_status()
    return Bench(server.http, server.settings.model_copy(update={"window_tracks": 20}))


@pytest.fixture
def bench(server, empty):
    return new_bench(server)


@pytest.fixture(scope="module")
def once_knocked(server, databases):
    """A camera that was knocked, and its database: how it came to that is the same every time."""
    copy_database(databases / "empty", server.settings.data_dir / DATABASE)
    bench = new_bench(server)
    for tilt_deg in (0.0, 0.1, 5.0, 5.0, 5.0):
        bench.see(moved(tilt_deg=tilt_deg, heading_deg=-0.6 * tilt_deg), paths=True)
    copy_database(server.settings.data_dir / DATABASE, databases / "knocked")
    return bench


@pytest.fixture
def knocked(server, databases, once_knocked):
    copy_database(databases / "knocked", server.settings.data_dir / DATABASE)
    return once_knocked


@pytest.fixture
def seen(page, knocked):
    """The page of a knocked camera, as it is once its charts are there."""
    page.goto(URL)
    page.wait_for_selector("#charts svg")
    return page
