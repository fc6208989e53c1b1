"""A site is moved to PostgreSQL whole, also when that is cut off, or nothing is."""

import hashlib
import shutil
from contextlib import contextmanager

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text

from service.app import create_app
from service.commands.postgresql.moving import move
from service.data_dir import StartError
from service.settings import Settings
from service.store import moving
from service.store.engines.store import Store
from service.store.trainings import ModelRecord
from service.training import begin_training
from tests.conftest import CAMERA, track
from tests.service.bench import Bench, moved
from tests.stores import server
from tests.stores.databases import ask

pytestmark = pytest.mark.skipif(not server.wanted(), reason="PostgreSQL only")


def quiet(table, done, total):
    assert 0 < done <= total, table


@contextmanager
def asked(settings):
    with TestClient(create_app(settings)) as http:
        yield http


@pytest.fixture
def file(settings, migrated, tmp_path):
    """A site on a file: cameras with estimates, an alert, acts, a model with its weights."""
    shutil.copytree(migrated, tmp_path / "site")
    site = settings.model_copy(update={"data_dir": tmp_path / "site", "database_url": None})
    with asked(site) as http:
        for name in ("corner", "gate"):
            http.post("/cameras", json={**CAMERA, "id": name}).raise_for_status()
        bench = Bench(http, site.model_copy(update={"window_tracks": 20}))
        for tilt_deg in (0, 5, 5, 5):
            bench.see(moved(tilt_deg=tilt_deg))
        assert bench.pose()["state"] == "drifting"
        http.post("/cameras/gate/tracks", json={"tracks": [track("a"), track("b")]})
        http.delete(
            "/cameras/gate", headers={"If-Match": http.get("/cameras/gate").headers["etag"]}
        )
        weights = b"weights of a model"
        sha256 = hashlib.sha256(weights).hexdigest()
        with bench.store.write() as session:
            session.query(ModelRecord).update({"weights_sha256": sha256})
        site.weights_dir.mkdir()
        (site.weights_dir / f"{sha256}.safetensors").write_bytes(weights)
        bench.store.close()
    return site


def told(http):
    """What is told of a site, but for what is worked out anew each time."""
    alerts = http.get("/alerts").json()
    return http.get("/cameras").json(), alerts, http.get("/activity").json(), pose_of(http)


def pose_of(http):
    body = http.get("/cameras/corner/pose").json()
    return {name: body[name] for name in ("state", "pose", "drift", "sd", "estimates", "model_id")}


def test_a_site_says_the_same_on_the_server(file, settings):
    with asked(file) as http:
        before = told(http)
    done = move(file.database_path, settings, quiet)
    assert done.rows["estimates"] == 4
    assert (done.rows["cameras"], done.weights, done.missing_weights) == (1, 1, 0)
    with asked(settings) as http:
        assert told(http) == before
        body = http.post("/cameras/corner/tracks", json={"tracks": [track("new")]}).json()
        assert body["accepted"] == 1
        new = ask(settings, "SELECT max(id) FROM activity")[0][0]
        http.post("/cameras/corner/reference/reset").raise_for_status()
        # Ids go on where they were, after those of what was deleted.
        assert ask(settings, "SELECT max(id) FROM activity")[0][0] > new
    with pytest.raises(StartError, match="check: "):  # what came since is no copy
        move(file.database_path, settings, quiet)


def test_cut_off_it_goes_on_and_run_again_it_changes_nothing(file, settings, monkeypatch):
    class CutOffError(Exception):
        pass

    def cut(table, done, total):
        if table == "tracks" and done > 30:
            raise CutOffError

    monkeypatch.setattr(moving, "_BITE", 10)
    with pytest.raises(CutOffError):
        move(file.database_path, settings, cut)
    begun = ask(settings, "SELECT count(*) FROM tracks")[0][0]
    assert begun == 40
    first = move(file.database_path, settings, quiet)
    assert first.rows["tracks"] == 80
    assert move(file.database_path, settings, quiet) == first


def test_a_difference_is_found(file, settings):
    move(file.database_path, settings, quiet)
    ask(settings, "UPDATE estimates SET tilt_rad = tilt_rad + 1e-15 WHERE id = 2")
    with pytest.raises(StartError, match="check: estimates has 4 rows with the hash"):
        move(file.database_path, settings, quiet)


def test_another_sites_database_is_left_alone(file, settings):
    with asked(settings) as http:
        http.post("/cameras", json={**CAMERA, "id": "elsewhere"}).raise_for_status()
    with pytest.raises(StartError, match="1 cameras are there that --from has not"):
        move(file.database_path, settings, quiet)
    assert ask(settings, "SELECT id FROM cameras") == [("elsewhere",)]


def test_a_file_of_another_revision_is_migrated_first(file, settings):
    ask(file, "UPDATE alembic_version SET version_num = 'another'")
    with pytest.raises(StartError, match="surefoot migrate --data-dir"):
        move(file.database_path, settings, quiet)


def test_what_waited_is_worked_on(file, settings):
    """Jobs are the engine's and stay behind; marks in the store say what is to be done."""
    with Store(file).write() as session:
        session.execute(text("UPDATE trainings SET state = 'queued'"))
        waiting = session.scalar(text("SELECT id FROM trainings"))
    move(file.database_path, settings, quiet)
    with Store(settings).write() as session:
        assert begin_training(session, Settings(), waiting) is not None
