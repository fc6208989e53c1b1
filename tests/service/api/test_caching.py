"""Which answers browsers and proxies may store."""

from fastapi.testclient import TestClient

from service.api.middleware.pages import STATIC_URL
from service.app import create_app
from tests.service.access.test_access import filled, routes_of

_STREAM = "/events"  # never ends; `test_fairness` reads the head of one
_FOR_EVER = "public, max-age=31536000, immutable"


def test_no_answer_is_stored_unless_its_route_allows_it(corner, settings):
    """Answers with poses, cameras and alerts had no `Cache-Control`."""
    stored = {}
    for method, path in sorted(routes_of(create_app(settings))):
        if path == _STREAM:
            continue
        answer = corner.request(method, filled(path), follow_redirects=False)
        stored.setdefault(answer.headers.get("cache-control"), set()).add(f"{method} {path}")
    assert stored.keys() == {"no-store", "private, no-cache", _FOR_EVER}
    # Asked for again and again: a browser may keep it, and asks whether it is still so.
    assert stored["private, no-cache"] == {"GET /cameras/{camera_id}/pose"}
    assert all(each.startswith("GET /ui/swagger") for each in stored[_FOR_EVER])


def test_pose_that_has_not_changed_is_not_sent_again(corner):
    first = corner.get("/cameras/corner/pose")
    assert first.headers["cache-control"] == "private, no-cache"
    again = corner.get("/cameras/corner/pose", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["cache-control"] == "private, no-cache"


def test_errors_and_logins_are_not_stored(settings):
    with TestClient(create_app(settings.model_copy(update={"auth": "on"}))) as closed:
        browser = {"Accept": "text/html", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Site": "none"}
        for path, headers, status in (
            ("/cameras", {}, 401),
            ("/", browser, 303),
            ("/ui/login", browser, 200),
            (f"{STATIC_URL}/nothing.js", {}, 404),
        ):
            answer = closed.get(path, headers=headers, follow_redirects=False)
            assert (answer.status_code, answer.headers["cache-control"]) == (status, "no-store")
