"""Pages log in with a token, and are known by a cookie until that ends."""

from datetime import UTC, datetime

import pytest
from fastapi.testclient import TestClient

from service.access import tokens
from service.access.tokens import TokenSpec
from service.api.middleware.authentication import COOKIE
from service.app import create_app
from service.store import access
from service.store.access import SessionRecord
from service.store.engines.store import Store
from tests.service.conftest import problem

PAGE = {"Accept": "text/html,*/*"}
PROXY = {"X-Surefoot-Proxy": "a secret of sixteen and more"}


@pytest.fixture
def on(settings):
    return settings.model_copy(update={"auth": "on"})


@pytest.fixture
def store(on):
    made = Store(on)
    yield made
    made.close()


@pytest.fixture
def closed(on):
    with TestClient(create_app(on), follow_redirects=False) as client:
        yield client


def token(store, *scopes, name="ada"):
    with store.write() as session:
        return tokens.make_token(session, TokenSpec(name=name, scopes=scopes), None).text


def log_in(client, text, **more):
    return client.post("/ui/login", data={"token": text, **more})


def test_who_looks_for_a_page_is_led_to_the_login_and_back(closed, store):
    assert closed.get("/", headers=PAGE).headers["Location"] == "/ui/login"
    led = closed.get("/ui/cameras/a?b=c", headers=PAGE).headers["Location"]
    form = closed.get(led, headers=PAGE)
    assert form.status_code == 200
    assert 'value="/ui/cameras/a?b=c"' in form.text
    assert "default-src 'self'" in form.headers["Content-Security-Policy"]
    answer = log_in(closed, token(store, "read"), next="/ui/cameras/a?b=c")
    assert (answer.status_code, answer.headers["Location"]) == (303, "/ui/cameras/a?b=c")
    page = closed.get("/", headers=PAGE)
    assert page.status_code == 200
    assert "ada" in page.text
    assert "Log out" in page.text


def test_what_a_page_fetches_is_no_page(closed):
    fetched = {**PAGE, "Sec-Fetch-Mode": "cors", "Sec-Fetch-Site": "same-origin"}
    for path in ("/", "/ui/cameras/a", "/ui/fleet/rows"):
        assert closed.get(path, headers=fetched).status_code == 401
    assert closed.get("/ui/fleet/rows", headers=PAGE).status_code == 401
    problem(closed.get("/cameras"), 401, "unauthorized")


def test_the_cookie_is_for_this_service_and_no_script(closed, store):
    cookie = log_in(closed, token(store, "read")).headers["set-cookie"]
    parts = {part.strip().lower() for part in cookie.split(";")}
    assert {"httponly", "samesite=lax", "path=/", "max-age=43200"} <= parts
    assert "secure" not in parts
    over_https = closed.post(
        "/ui/login",
        data={"token": token(store, "read")},
        headers={"Origin": "https://testserver", "Host": "testserver"},
    )
    assert "secure" in over_https.headers["set-cookie"].lower()


def test_nothing_of_a_session_is_kept_that_could_be_used(closed, store, on):
    log_in(closed, token(store, "read"))
    for path in on.data_dir.glob("surefoot.sqlite*"):
        assert closed.cookies[COOKIE].encode() not in path.read_bytes()


def test_a_wrong_token_is_told_and_a_trackers_is_not_for_pages(closed, store):
    answer = log_in(closed, "sf_0_<b>")
    assert answer.status_code == 401
    assert "nobody is let in" in answer.text
    assert "<b>" not in answer.text
    assert log_in(closed, token(store, "ingest")).status_code == 403
    assert COOKIE not in closed.cookies
    for _ in range(10):
        answer = log_in(closed, "sf_0_0")
    assert answer.status_code == 429
    assert "Retry-After" in answer.headers


@pytest.mark.parametrize("end", ["logout", "revoked", "over", "token over"])
def test_a_session_ends(closed, store, end):
    text = token(store, "operate")
    log_in(closed, text)
    assert closed.get("/cameras").status_code == 200
    with store.write() as session:
        (record,) = session.query(SessionRecord).all()
        if end == "revoked":
            tokens.revoke_token(session, record.token_id, None)
        elif end == "over":
            record.expires_at = datetime.now(UTC)
        elif end == "token over":
            access.every(session)[0].expires_at = datetime.now(UTC)
    cookie = closed.cookies[COOKIE]
    if end == "logout":
        assert closed.post("/ui/logout").headers["Location"] == "/ui/login"
        assert COOKIE not in closed.cookies
    problem(closed.get("/cameras", headers={"Cookie": f"{COOKIE}={cookie}"}), 401, "unauthorized")
    if end in ("logout", "revoked"):
        with store.read() as session:
            assert session.query(SessionRecord).count() == 0


def test_a_new_session_forgets_those_that_are_over(closed, store):
    text = token(store, "read")
    log_in(closed, text)
    with store.write() as session:
        session.query(SessionRecord).one().expires_at = datetime.now(UTC)
    log_in(closed, text)
    with store.read() as session:
        assert session.query(SessionRecord).count() == 1


@pytest.mark.parametrize(
    "wanted",
    ["https://evil.example", "//evil.example", "/\\evil.example", "javascript:alert(1)", "a\r\nb"],
)
def test_a_login_leads_nowhere_else(closed, store, wanted):
    assert log_in(closed, token(store, "read"), next=wanted).headers["Location"] == "/"


def test_a_page_of_others_logs_nobody_in(closed, store):
    answer = closed.post(
        "/ui/login",
        data={"token": token(store, "read")},
        headers={"Origin": "http://evil.example"},
    )
    problem(answer, 403, "foreign_origin")


def test_a_form_has_its_size(closed):
    problem(log_in(closed, "x" * 20_000), 413, "too_large")
    problem(closed.post("/ui/login", json={}), 415, "unsupported_media_type")


def test_who_may_only_look_sees_a_page_that_says_so(closed, store):
    log_in(closed, token(store, "read"))
    answer = closed.get("/ui/tokens", headers=PAGE)
    assert answer.status_code == 403
    assert "You may look, but not do this." in answer.text
    assert "/ui/register" not in answer.text


def test_tokens_are_made_and_revoked_on_a_page(closed, store):
    log_in(closed, token(store, "admin"))
    made = closed.post(
        "/ui/tokens",
        data={"name": "<gate>", "scopes": ["ingest"], "cameras": "a, b", "days": "90"},
    )
    assert made.status_code == 200
    text = made.text.split('id="made">')[1].split("<")[0]
    assert "&lt;gate&gt;" in made.text
    listed = closed.get("/tokens").json()["items"][1]
    assert (listed["cameras"], listed["created_by"]) == (["a", "b"], "ada")
    assert listed["expires_at"] is not None
    assert text not in closed.get("/ui/tokens").text
    wrong = closed.post("/ui/tokens", data={"name": "x", "days": "soon"})
    assert wrong.status_code == 422
    assert "a number of days" in wrong.text
    closed.post(f"/ui/tokens/{text.split('_')[1]}/revoke")
    assert closed.get("/tokens").json()["items"][1]["state"] == "revoked"


@pytest.fixture
def behind(settings):
    """The application behind a proxy that is where the client is."""
    changed = settings.model_copy(
        update={"proxy_from": "10.1.0.0/16", "proxy_secret": PROXY["X-Surefoot-Proxy"]}
    )
    with (
        TestClient(create_app(changed), client=("10.1.2.3", 1)) as inside,
        TestClient(create_app(changed), client=("10.2.2.3", 1)) as outside,
    ):
        yield inside, outside


def test_a_proxy_is_believed_by_its_address_and_its_secret(behind):
    inside, _ = behind
    who = {"X-Forwarded-User": "grace", "X-Forwarded-Role": "staff, operate"}
    assert inside.get("/cameras", headers={**PROXY, **who}).status_code == 200
    assert "grace" in inside.get("/", headers={**PROXY, **who, **PAGE}).text
    problem(inside.post("/cameras", json={}, headers={**PROXY, **who}), 403, "forbidden")
    nobody = {"X-Forwarded-User": " "}
    alone = {"X-Forwarded-User": "grace"}
    for headers in (
        who,
        {**who, "X-Surefoot-Proxy": "another secret of many letters"},
        {**PROXY},
        {**PROXY, **nobody},
    ):
        assert inside.get("/cameras", headers=headers).status_code == 401
    # Without a role one may look, and a role of trackers is none of persons.
    assert inside.get("/cameras", headers={**PROXY, **alone}).status_code == 200
    role = {**PROXY, **alone, "X-Forwarded-Role": "ingest"}
    assert inside.post("/cameras/a/tracks", json={}, headers=role).status_code == 403


def test_nobody_else_is_believed_to_be_the_proxy(behind):
    inside, outside = behind
    headers = {**PROXY, "X-Forwarded-User": "grace", "X-Forwarded-Role": "admin"}
    assert inside.get("/tokens", headers=headers).status_code == 200
    forged = {**headers, "X-Forwarded-For": "10.1.2.3"}
    assert outside.get("/tokens", headers=forged).status_code == 401


def test_a_proxy_without_a_secret_is_a_bad_setting(settings):
    with pytest.raises(ValueError, match="PROXY_SECRET"):
        type(settings)(proxy_from="10.0.0.0/8")
