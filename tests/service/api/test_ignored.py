"""Unknown fields of bodies are named in the answer and refuse nothing, but where that is unsafe."""

import copy
from datetime import UTC, datetime, timedelta

import pytest

from tests.conftest import CAMERA
from tests.service.conftest import problem


def test_a_registration_of_a_newer_client_is_taken(http):
    body = copy.deepcopy(CAMERA) | {"floor": "town/centre", "x" * 200: 1}
    body["intrinsics"]["skew"] = 0
    body["prior_pose"]["sd_deg"] = [1, {}]
    answer = http.post("/cameras", json=body)
    assert answer.status_code == 201
    assert answer.headers["location"] == "/cameras/corner"
    assert answer.headers["etag"]
    names = ["floor", "x" * 80, "intrinsics/skew", "prior_pose/sd_deg"]
    assert answer.json()["ignored"] == names
    assert answer.json()["questions"] == []
    assert "ignored" not in http.get("/cameras/corner").json()


def test_a_misspelt_change_changes_nothing_and_says_so(corner):
    etag = {"If-Match": corner.get("/cameras/corner").headers["etag"]}
    answer = corner.patch("/cameras/corner", json={"nmae": "x"}, headers=etag)
    assert (answer.status_code, answer.json()["ignored"]) == (200, ["nmae"])
    assert answer.json()["name"] == CAMERA["name"]


def test_names_that_are_known_by_another_are_not_named(corner):
    now = datetime.now(UTC)
    ends = {"from": now.isoformat(), "to": (now + timedelta(hours=1)).isoformat()}
    body = ends | {"from_": "x"}
    answer = corner.post("/cameras/corner/maintenance", json=body)
    assert answer.status_code == 201, answer.text
    assert answer.json()["ignored"] == ["from_"]


def test_of_very_many_names_some_are_said(http):
    answer = http.post("/cameras", json=CAMERA | {f"x{n}": n for n in range(1000)})
    assert answer.json()["ignored"] == [f"x{n}" for n in range(20)]


@pytest.mark.parametrize("field", ["camera", "expires"])
def test_a_misspelt_limit_of_a_token_makes_no_token(http, field):
    body = {"name": "edge", "scopes": ["ingest"], field: "x"}
    document = problem(http.post("/tokens", json=body), 422, "malformed")
    assert document["errors"][0]["pointer"] == f"/{field}"
