"""Pages of others and names of others: what a browser sends for them is refused."""

import re

import pytest
from fastapi.testclient import TestClient

from service.api.middleware.pages import STATIC_URL
from service.api.middleware.scopes import NEEDS
from service.app import create_app
from service.store.record import Record
from tests.service.conftest import problem
from tests.stores.databases import ask

FORM = {"Content-Type": "text/plain"}
ACTIONS = [
    ("POST", "/cameras/corner/reference/reset"),
    ("POST", "/cameras/corner/trainings"),
    ("POST", "/cameras/corner/tracks"),
    ("POST", "/alerts/some/acknowledge"),
    ("POST", "/webhooks/some/secret"),
    ("POST", "/ui/calibration"),
    ("DELETE", "/cameras/corner"),
    ("PUT", "/cameras/corner/snapshot"),
    ("PATCH", "/webhooks/some"),
]
FOREIGN = [
    {"Sec-Fetch-Site": "cross-site", "Origin": "http://evil.example"},
    {"Sec-Fetch-Site": "same-site", "Origin": "http://testserver:1"},
    {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"},
    {"Origin": "http://evil.example"},
    {"Origin": "http://testserver:1"},
    {"Origin": "http://testserver.evil.example"},
    {"Origin": "null"},
    {"Origin": "file://"},
    {"Origin": "http://[testserver"},
]


@pytest.mark.parametrize(("method", "path"), ACTIONS)
def test_no_page_of_others_acts(corner, method, path):
    trainings = corner.get("/cameras/corner/trainings").json()
    for headers in FOREIGN:
        answer = corner.request(method, path, headers={**FORM, **headers}, content=b"{}")
        problem(answer, 403, "foreign_origin")
    assert corner.get("/cameras/corner/trainings").json() == trainings


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Sec-Fetch-Site": "same-origin", "Origin": "http://testserver"},
        {"Sec-Fetch-Site": "none"},
        {"Origin": "http://testserver"},
        {"Origin": "http://TESTSERVER:80"},
        {"Origin": "https://testserver", "Host": "testserver:443"},  # behind a proxy
    ],
)
def test_pages_of_ours_and_programs_act(corner, headers):
    answer = corner.post("/cameras/corner/reference/reset", headers=headers)
    assert answer.status_code == 200, answer.text


def test_a_page_behind_a_proxy_that_names_another_host_acts(settings):
    changed = settings.model_copy(update={"public_url": "https://cameras.example/", "auth": "off"})
    with TestClient(create_app(changed)) as http:
        for origin, status in (("https://cameras.example", 404), ("http://cameras.example", 403)):
            answer = http.post("/cameras/no/reference/reset", headers={"Origin": origin})
            assert answer.status_code == status, answer.text
        assert http.get("/cameras", headers={"Host": "cameras.example"}).status_code == 200


def test_what_is_asked_from_within_another_page_is_refused(corner):
    for mode, dest in (("no-cors", "image"), ("cors", "empty"), ("navigate", "iframe")):
        headers = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": dest}
        for path in ("/cameras", "/events", "/cameras/corner/snapshot", "/"):
            problem(corner.get(path, headers=headers), 403, "foreign_origin")
    link = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate"}
    answer = corner.get("/ui/cameras/corner", headers={**link, "Sec-Fetch-Dest": "document"})
    assert answer.status_code == 200


def test_no_answer_is_taken_for_anything_else_or_shown_elsewhere(corner):
    foreign = {"Host": "elsewhere.example"}
    asked = (
        ("/cameras", {}, 200), ("/ui/register", {}, 200), (f"{STATIC_URL}/events.js", {}, 200),
        ("/cameras/none", {}, 404), ("/nowhere", {}, 404), ("/cameras", foreign, 421),
    )  # fmt: skip
    for path, headers, status in asked:
        answer = corner.get(path, headers=headers)
        assert answer.status_code == status
        assert answer.headers["X-Content-Type-Options"] == "nosniff", path
        assert answer.headers["Cross-Origin-Resource-Policy"] == "same-origin", path


@pytest.mark.parametrize(
    ("bound", "allowed", "host", "status"),
    [
        ("127.0.0.1", "", "127.0.0.1:8080", 200),
        ("127.0.0.1", "", "localhost", 200),
        ("127.0.0.1", "", "LOCALHOST.:1", 200),
        ("127.0.0.1", "", "[::1]:8080", 200),
        ("127.0.0.1", "", "evil.example", 421),
        ("127.0.0.1", "", "localhost.evil.example", 421),
        ("127.0.0.1", "", "127.0.0.1.evil.example", 421),
        ("127.0.0.1", "", "10.0.0.7", 421),
        ("127.0.0.1", "", "", 421),
        ("127.0.0.1", "", "[", 421),
        ("127.0.0.1", "a.example, B.example", "b.example:99", 200),
        ("0.0.0.0", "", "10.0.0.7:8080", 200),
        ("0.0.0.0", "", "evil.example", 421),
        ("::", "", "[fe80::1]", 200),
        ("cameras.lan", "", "cameras.lan", 200),
        ("cameras.lan", "", "other.lan", 421),
    ],
)
def test_only_names_of_ours_are_served(settings, bound, allowed, host, status):
    changed = settings.model_copy(update={"host": bound, "allowed_hosts": allowed, "auth": "off"})
    with TestClient(create_app(changed)) as http:
        answer = http.get("/cameras", headers={"Host": host})
        assert answer.status_code == status, answer.text
        if status == 421:
            problem(answer, 421, "misdirected")
            assert http.get("/readyz", headers={"Host": host}).status_code == 421
        assert http.get("/healthz", headers={"Host": host}).status_code == 200


def test_looking_changes_nothing(corner, settings):
    """What a link or a picture of a page of others can ask for is harmless."""
    # `/readyz` writes one row anew, to see whether it can; `/events` has no end.
    paths = {path for method, path in NEEDS if method == "GET"} - {"/readyz", "/events"}
    before = dump(settings)
    for path in sorted(paths):
        answer = corner.get(re.sub(r"{[\w:]+}", "corner", path), headers={"Accept": "text/html"})
        assert answer.status_code < 500, path
    assert dump(settings) == before


def dump(settings):
    tables = [table.name for table in Record.metadata.sorted_tables]
    return {name: sorted(map(repr, ask(settings, f"SELECT * FROM {name}"))) for name in tables}
