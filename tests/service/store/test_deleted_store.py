"""A database file that is deleted or replaced while the service runs."""

import os
import shutil
import time

import pytest

from service.errors import StoreUnavailableError
from service.store.engines.store import Store
from tests.conftest import track
from tests.service.conftest import problem
from tests.stores.databases import only_sqlite

pytestmark = only_sqlite("deletes the file")


def post(http, number):
    body = {"tracks": [track(str(number), start_s=time.time() - 60 + number)]}
    return http.post("/cameras/corner/tracks", json=body)


def test_posts_after_data_directory_is_deleted_are_refused(corner, settings):
    """Four of them got 202."""
    assert post(corner, 0).json()["accepted"] == 1
    shutil.rmtree(settings.data_dir)
    for number in range(1, 5):
        document = problem(post(corner, number), 503, "store_unavailable")
        assert document["detail"] == (
            f"store: {settings.database_path} was deleted or replaced while the service was "
            "running; put the file back or restart the service; nothing was stored"
        )
    ready = corner.get("/readyz")
    assert (ready.status_code, ready.json()["store_writable"]) == (503, False)
    assert ready.json()["problems"][0].startswith(f"store: {settings.database_path} was deleted")


def test_posts_are_accepted_once_the_file_is_back(corner, settings):
    assert post(corner, 0).json()["accepted"] == 1
    away = settings.data_dir.with_name("away")
    settings.data_dir.rename(away)
    problem(post(corner, 1), 503, "store_unavailable")
    away.rename(settings.data_dir)
    assert post(corner, 1).json()["accepted"] == 1
    assert corner.get("/cameras/corner/sources").json()["items"][0]["tracks"] == 2


def test_another_file_at_the_path_is_refused_on_old_and_new_connections(corner, settings):
    assert post(corner, 0).json()["accepted"] == 1
    copy = settings.data_dir / "copy"
    shutil.copy(settings.database_path, copy)
    os.replace(copy, settings.database_path)
    problem(post(corner, 1), 503, "store_unavailable")
    corner.app_state["app"].store.engine.dispose()
    problem(post(corner, 1), 503, "store_unavailable")


@pytest.mark.parametrize("about", [None, "corner"])
def test_every_way_to_write_refuses_a_deleted_file(settings, about):
    store = Store(settings)
    with store.write(about):
        pass
    shutil.rmtree(settings.data_dir)
    with pytest.raises(StoreUnavailableError), store.write(about):
        raise AssertionError
    with pytest.raises(StoreUnavailableError), store.change(about):
        raise AssertionError
    with pytest.raises(StoreUnavailableError):
        store.write_if_needed(about, lambda session: None)
    store.close()
