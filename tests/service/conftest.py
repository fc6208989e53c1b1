from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from tests.conftest import CAMERA
from tests.service.bench import Bench
from tests.service.post_room import PostRoom


@pytest.fixture
def http(settings: Settings) -> Iterator[TestClient]:
    """The application over a real, migrated SQLite file; no worker."""
    with TestClient(create_app(settings)) as client:
        yield client


@pytest.fixture
def corner(http: TestClient) -> TestClient:
    """The same, with the camera `corner` registered."""
    assert http.post("/cameras", json=CAMERA).status_code == 201
    return http


@pytest.fixture
def bench(corner: TestClient, settings: Settings) -> Bench:
    """The camera `corner` with a reference, and estimates that a test makes up."""
    return Bench(corner, settings.model_copy(update={"window_tracks": 20}))


def problem(answer: httpx.Response, status: int, code: str) -> dict[str, Any]:
    """The problem document of an answer."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: dict[str, Any] = answer.json()
    assert (document["status"], document["code"]) == (status, code)
    return document


@pytest.fixture
def post_room(settings: Settings) -> Iterator[PostRoom]:
    """The application with a camera, which may send to this machine itself."""
    changed = settings.model_copy(update={"webhook_allow": "127.0.0.0/8"})
    with TestClient(create_app(changed)) as client:
        yield PostRoom(client, changed)
