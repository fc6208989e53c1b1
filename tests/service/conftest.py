import pickle
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from service.store.engines.store import Store
from tests.conftest import CAMERA, Once
from tests.service.bench import Bench
from tests.service.fleet_bench import Fleet
from tests.service.notifications.post_room import PostRoom
from tests.service.notifications.receiver import Receiver, receiver
from tests.service.street import Street
from tests.stores import databases

MakeStreet = Callable[[TestClient, Settings], Street]


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
def store(settings: Settings) -> Iterator[Store]:
    """The store of the application, opened by a test itself."""
    with closing(Store(settings)) as made:
        yield made


@pytest.fixture
def bench(corner: TestClient, settings: Settings) -> Bench:
    """The camera `corner` with a reference, and estimates that a test makes up."""
    return Bench(corner, settings.model_copy(update={"window_tracks": 20}))


@pytest.fixture
def fleet(http: TestClient, settings: Settings) -> Iterator[Fleet]:
    """Cameras, estimates and alerts written straight into the store of the application."""
    made = Fleet(settings)
    yield made
    made.close()


@pytest.fixture
def learned(settings: Settings, once: Once) -> Iterator[Callable[[str, MakeStreet], Street]]:
    """A street by its name that goes on where `make` left it; learning is done once a run.

    Tests of one name share its data directory and its people, each with a copy of its own.
    """
    opened: list[tuple[Street, TestClient]] = []

    def kept_in(folder: Path) -> dict[str, Any]:
        name = f"street_{folder.name.removesuffix('.unfinished')}"
        url = databases.named_like(settings, name.lower().replace("-", "_")[:60])
        return {"data_dir": folder / "data", "database_url": url}

    def begin(name: str, make: MakeStreet) -> Street:
        def build(folder: Path) -> None:
            first = settings.model_copy(update=kept_in(folder))
            databases.copy_store(settings, first)
            with TestClient(create_app(first)) as http:
                made = make(http, first)
                made.close()
            (folder / "street").write_bytes(pickle.dumps(made))

        kept = once(name, build)
        databases.copy_store(settings.model_copy(update=kept_in(kept)), settings)
        street: Street = pickle.loads((kept / "street").read_bytes())
        http = TestClient(create_app(settings)).__enter__()
        opened.append((street, http))
        # The job may have settings of its own, beside those of the application.
        changed = vars(street).pop("settings")
        mine = {name: getattr(settings, name) for name in ("data_dir", "database_url")}
        street.go_on(http, changed.model_copy(update=mine))
        return street

    yield begin
    for street, http in opened:
        street.close()
        http.__exit__(None, None, None)


def problem(answer: httpx.Response, status: int, code: str) -> dict[str, Any]:
    """The problem document of an answer."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: dict[str, Any] = answer.json()
    assert (document["status"], document["code"]) == (status, code)
    return document


@pytest.fixture
def inbox() -> Iterator[Receiver]:
    """A receiver of webhooks."""
    with receiver() as found:
        yield found


@pytest.fixture
def post_room(settings: Settings) -> Iterator[PostRoom]:
    """The application with a camera, which may send to this machine itself."""
    changed = settings.model_copy(update={"webhook_allow": "127.0.0.0/8"})
    with TestClient(create_app(changed)) as client:
        yield PostRoom(client, changed)
