"""NUL characters, which no text of PostgreSQL's can have: refused before the store is asked."""

import re

import pytest
from starlette.testclient import TestClient

from service.app import create_app
from tests.conftest import CAMERA

FORM = {"content-type": "application/x-www-form-urlencoded"}


@pytest.fixture
def http(settings):
    with TestClient(create_app(settings), raise_server_exceptions=False) as client:
        client.post("/cameras", json={**CAMERA, "id": "ok"}).raise_for_status()
        yield client


def test_no_path_has_a_name_with_one(http):
    asked = []
    for path, operations in http.get("/openapi.json").json()["paths"].items():
        for name in re.findall(r"\{[^}]+\}", path):
            spoilt = path.replace(name, "a%00b").replace("{camera_id}", "ok")
            spoilt = re.sub(r"\{[^}]+\}", "x", spoilt)
            for method in operations:
                answer = http.request(method.upper(), spoilt, headers={"If-Match": '"1"'})
                asked.append(spoilt)
                assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), spoilt
    assert len(asked) > 30


@pytest.mark.parametrize(
    "path",
    [
        "/activity?camera_id=%00",
        "/alerts?camera_id=a%00",
        "/alerts?group_id=%00",
        "/cameras?cursor=%00",
        "/ui/fleet/rows?ids=ok,%00",
    ],
)
def test_no_query_asks_for_one(http, path):
    answer = http.get(path)
    assert answer.status_code == 422, path
    assert "NUL" in answer.text
    assert http.get(path.replace("%00", "b")).status_code == 200


def test_no_form_has_one(http):
    answer = http.post("/ui/tokens", content="name=a%00b&scopes=read", headers=FORM)
    assert answer.status_code == 422
    assert "NUL" in answer.text
