"""The same people come to the same pose and alerts, to the printed digits, whichever database."""

import shutil

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from tests.conftest import CAMERA
from tests.service.street import KNOCKED, PRIOR, Street, lately_s
from tests.stores import server

pytestmark = pytest.mark.skipif(not server.wanted(), reason="PostgreSQL only")

TOLD = ("state", "reason", "pose", "estimated", "sd", "drift", "estimates", "reference", "tracks")
ALERTED = ("kind", "state", "severity", "reason", "drift", "changed_at", "outcome")


def told_on(settings, begun_s):
    """What is told of a street whose camera is knocked, after each look."""
    with TestClient(create_app(settings)) as http:
        http.post("/cameras", json={**CAMERA, "reference_tracks": 60}).raise_for_status()
        street = Street(http, settings)
        street.clock_s = begun_s
        said = []
        for pose, people in ((PRIOR, 60), (PRIOR, 40), (KNOCKED, 60), (KNOCKED, 60)):
            street.walk(pose, people)
            body = street.look()
            alerts = [{name: each[name] for name in ALERTED} for each in street.alerts()]
            said.append(({name: body[name] for name in TOLD}, alerts))
        street.close()
    return said


def test_a_knocked_camera_is_told_of_to_the_same_digits(settings, migrated, tmp_path):
    shutil.copytree(migrated, tmp_path / "file")
    file = settings.model_copy(update={"data_dir": tmp_path / "file", "database_url": None})
    # lately: of older people the words tell how many hours ago they walked, which goes on meanwhile
    begun_s = lately_s()
    on_server, on_file = told_on(settings, begun_s), told_on(file, begun_s)
    assert on_server == on_file
    assert on_file[-1][0]["state"] == "drifting"
    assert [alert["kind"] for alert in on_file[-1][1]] == ["drift"]
