"""Tokens and what they let in, over the application with access on."""

import re
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.routing import iter_route_contexts
from fastapi.testclient import TestClient

from service.access import tokens
from service.access.tokens import TokenSpec
from service.api.middleware.hosts import auth_on
from service.api.middleware.scopes import NEEDS, need_of
from service.app import create_app
from service.store import access
from service.store.engines.store import Store
from tests.conftest import CAMERA, track
from tests.service.conftest import problem

SCOPES = ("ingest", "read", "operate", "admin")


@pytest.fixture
def on(settings):
    return settings.model_copy(update={"auth": "on"})


@pytest.fixture
def closed(on):
    """The application with access on; nobody is let in yet."""
    with TestClient(create_app(on)) as client:
        yield client


@pytest.fixture
def made(on):
    """Makes tokens: `made("read")` is the header of a token for reading."""
    store = Store(on)

    def make(*scopes, cameras=None, name="ada", expires_at=None):
        spec = TokenSpec(name=name, scopes=scopes, cameras=cameras, expires_at=expires_at)
        with store.write() as session:
            return bearer(tokens.make_token(session, spec, None).text)

    yield make
    store.close()


def bearer(token):
    return {"Authorization": f"Bearer {token}"}


def routes_of(app):
    """Every method and path that the application has."""
    for context in iter_route_contexts(app.routes):
        if context.methods:  # static files have none
            yield from ((method, context.path) for method in context.methods - {"HEAD"})


def filled(path):
    return re.sub(r"{[\w:]+}", "corner", path)


def test_every_route_says_what_it_needs(settings):
    app = create_app(settings)
    found = set(routes_of(app))
    assert ("POST", "/cameras/{camera_id}/tracks") in found
    assert len(found) > 50
    assert found - NEEDS.keys() == set()
    assert NEEDS.keys() - found == set()


def test_a_path_without_parameters_is_not_taken_for_another():
    assert need_of("GET", "/ui/login")[0] is None
    assert need_of("HEAD", "/ui/tokens")[0] == "admin"
    assert need_of("POST", "/nowhere")[0] == "admin"
    assert need_of("GET", "/nowhere")[0] == "read"
    assert need_of("GET", "/healthz/")[0] == "read"


def test_a_stranger_is_let_in_nowhere(closed, settings):
    for method, path in routes_of(create_app(settings)):
        if NEEDS[method, path] is None:
            continue
        for headers in ({}, bearer("sf_0_0"), {"Authorization": "Basic YTpi"}, {"Cookie": "x=y"}):
            answer = closed.request(method, filled(path), headers=headers)
            assert answer.status_code in (401, 429), (method, path, answer.text)
            assert answer.headers["content-type"] == "application/problem+json"
    document = problem(closed.get("/cameras"), 401, "unauthorized")
    assert "token" in document["detail"]
    assert closed.get("/cameras").headers["WWW-Authenticate"].startswith("Bearer")
    assert closed.get("/nowhere").status_code == 401
    assert closed.get("/healthz").status_code == 200


@pytest.mark.parametrize("scope", SCOPES)
def test_each_scope_is_let_in_where_it_says_and_nowhere_else(closed, made, scope, settings):
    holds = {"ingest": {"ingest"}, "read": {"read"}, "operate": {"read", "operate"}}
    holds["admin"] = {"read", "operate", "admin"}
    headers = made(scope)
    for method, path in routes_of(create_app(settings)):
        need = NEEDS[method, path]
        if need is None or path in ("/events", "/ui/logout"):
            continue
        answer = closed.request(method, filled(path), headers=headers)
        if need in holds[scope]:
            assert answer.status_code not in (401, 403) or "switched_off" in answer.text, path
        else:
            assert problem(answer, 403, "forbidden")["detail"].startswith(
                f"scope: this needs {need}"
            )


def test_who_may_not_register_is_not_asked_to(closed, made):
    """A viewer saw "Add a camera", and read "scope: this needs admin" after it."""
    viewer = made("read")
    assert "/ui/register" not in closed.get("/", headers=viewer).text
    refused = closed.get("/ui/register", headers={**viewer, "Accept": "text/html"})
    assert (refused.status_code, "scope:" in refused.text) == (403, False)
    assert "You may look, but not do this." in refused.text
    assert "/ui/register" in closed.get("/", headers=made("admin")).text


def test_who_may_look_alone_is_not_asked_to_draw(closed, made):
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    closed.post("/cameras", json=bare, headers=made("admin")).raise_for_status()
    pages = [
        closed.get("/ui/cameras/corner", headers=made(scope)).text for scope in ("read", "operate")
    ]
    for part in ("draw-zones", "zones.js", 'id="over"', "hints.js"):
        assert [part in text for text in pages] == [False, True], part


def test_a_tracker_posts_for_its_cameras_alone(closed, made):
    admin = made("admin")
    for camera_id in ("corner", "gate"):
        answer = closed.post("/cameras", json={**CAMERA, "id": camera_id}, headers=admin)
        assert answer.status_code == 201, answer.text
    tracker = made("ingest", cameras=("corner",), name="tracker")
    body = {"tracks": [track("1", datetime.now(UTC).timestamp() - 60)]}
    posted = closed.post("/cameras/corner/tracks", json=body, headers=tracker)
    assert posted.json()["accepted"] == 1
    answer = closed.post("/cameras/gate/tracks", json=body, headers=tracker)
    assert "other cameras" in problem(answer, 403, "forbidden")["detail"]
    problem(closed.post("/cameras/corner/tracks", json=body, headers=admin), 403, "forbidden")


def test_a_token_is_shown_once_and_kept_as_a_hash(closed, made, on):
    answer = closed.post(
        "/tokens",
        json={"name": "grace", "scopes": ["read", "ingest"], "cameras": ["corner"]},
        headers=made("admin"),
    )
    assert answer.status_code == 201
    document = answer.json()
    assert re.fullmatch(r"sf_[0-9a-f]{12}_[A-Za-z0-9_-]{43}", document["token"])
    assert document["created_by"] == "ada"
    secret = document["token"].split("_", 2)[2]
    listed = closed.get("/tokens", headers=made("admin"))
    assert secret not in listed.text
    assert [item["name"] for item in listed.json()["items"]] == ["ada", "grace", "ada"]
    for path in on.data_dir.glob("surefoot.sqlite*"):
        assert secret.encode() not in path.read_bytes()


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"name": "", "scopes": ["read"]}, "name"),
        ({"name": "a\nb", "scopes": ["read"]}, "name"),
        ({"name": "a", "scopes": []}, "scopes"),
        ({"name": "a", "scopes": ["read"], "expires_at": "9999-12-31T23:59:59-14:00"}, "expires"),
        ({"name": "a", "scopes": ["root"]}, "scopes"),
        ({"name": "a", "scopes": ["read"], "cameras": ["corner"]}, "cameras"),
        ({"name": "a", "scopes": ["read"], "expires_at": "2020-01-01T00:00:00Z"}, "expires_at"),
    ],
)
def test_a_token_for_nothing_is_refused(closed, made, body, field):
    document = problem(closed.post("/tokens", json=body, headers=made("admin")), 422, "malformed")
    assert document["errors"][0]["pointer"].startswith(f"/{field}")


def test_a_token_that_is_revoked_or_over_lets_nobody_in(closed, made, on):
    reader, admin = made("read"), made("admin")
    token_id = reader["Authorization"].split("_")[1]
    assert closed.get("/cameras", headers=reader).status_code == 200
    assert closed.delete(f"/tokens/{token_id}", headers=admin).status_code == 204
    problem(closed.get("/cameras", headers=reader), 401, "unauthorized")
    problem(closed.delete("/tokens/none", headers=admin), 404, "not_found")
    short = made("read", expires_at=datetime.now(UTC) + timedelta(seconds=0.2))
    with Store(on).write() as session:
        record = access.every(session)[-1]
        record.expires_at = datetime.now(UTC)
    problem(closed.get("/cameras", headers=short), 401, "unauthorized")


def test_no_other_secret_will_do(closed, made):
    good = made("admin")["Authorization"].removeprefix("Bearer ")
    token_id = good.split("_")[1]
    for bad in (good[:-1], good + "a", f"sf_{token_id}_", f"sf_{token_id}", "", "sf__", "\xff"):
        answer = closed.get("/cameras", headers={"Authorization": f"Bearer {bad}".encode("latin1")})
        assert answer.status_code == 401
    assert closed.get("/cameras", headers=bearer(good)).status_code == 200


def test_when_a_token_was_used_is_kept_to_the_minute(closed, made, on):
    reader, admin = made("read"), made("admin")
    closed.get("/cameras", headers=reader)
    first = closed.get("/tokens", headers=admin).json()["items"][0]["used_at"]
    assert first is not None
    closed.get("/cameras", headers=reader)
    assert closed.get("/tokens", headers=admin).json()["items"][0]["used_at"] == first


def test_who_guesses_is_told_to_wait_and_nobody_else(closed, made):
    for _ in range(10):
        assert closed.get("/cameras", headers=bearer("sf_0_0")).status_code == 401
    answer = closed.get("/cameras", headers=bearer("sf_0_0"))
    problem(answer, 429, "too_many_requests")
    assert 0 < int(answer.headers["Retry-After"]) <= 61
    admin = made("admin")
    assert closed.get("/cameras", headers=admin).status_code == 200
    entries = closed.get("/activity", headers=admin).json()["items"]
    refused = [entry for entry in entries if entry["what"] == "login.refused"]
    assert len(refused) == 1  # guesses must not fill the log
    assert refused[0]["address"] == "testclient"


def test_with_access_off_nothing_is_asked(corner):
    assert corner.get("/tokens", headers=bearer("sf_0_0")).status_code == 200
    assert corner.get("/ui/login", follow_redirects=False).headers["Location"] == "/"


@pytest.mark.parametrize(
    ("changes", "on"),
    [
        ({}, False),
        ({"host": "localhost"}, False),
        ({"host": "::1"}, False),
        ({"host": "0.0.0.0"}, True),
        ({"host": "::"}, True),
        ({"host": "10.0.0.7"}, True),
        ({"host": "cameras.lan"}, True),
        ({"host": "0.0.0.0", "auth": "off"}, False),
        ({"auth": "on"}, True),
        ({"public_url": "https://cameras.example"}, True),
        ({"public_url": "http://localhost:8080"}, False),
        ({"proxy_from": "127.0.0.1/32", "proxy_secret": "x" * 16}, True),
    ],
)
def test_access_is_on_wherever_others_may_ask(settings, changes, on):
    assert auth_on(settings.model_copy(update=changes)) is on


def test_what_is_wrong_is_told_to_who_may_read_alone(closed, made):
    for headers in ({}, bearer("sf_0_0"), made("ingest")):
        answer = closed.get("/readyz", headers=headers)
        assert (answer.status_code, answer.json()["status"]) == (503, "not_ready")
        assert answer.json()["problems"] == []
    assert closed.get("/readyz", headers=made("read")).json()["problems"]
