"""`/docs` and the files of packages that pages need: from this host, packed, kept by browsers."""

import gzip
import re

import pytest

from service.api.middleware.pages import VIEWER_SCRIPT_URL, VIEWER_STYLE_URL


def test_the_viewer_asks_no_other_host_and_runs_nothing_inline(http):
    answer = http.get("/docs")
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy
    named = re.findall(r'(?:src|href)="([^"]+)"', answer.text)
    assert VIEWER_SCRIPT_URL in named
    assert VIEWER_STYLE_URL in named
    for path in named:
        assert path.startswith("/")
        assert not path.startswith("//")
        assert http.get(path).status_code == 200, path
    assert not re.search(r"<script>|<style| style=| onclick=", answer.text)


@pytest.mark.parametrize(
    ("url", "media_type"),
    [(VIEWER_SCRIPT_URL, "text/javascript"), (VIEWER_STYLE_URL, "text/css")],
)
def test_its_files_are_those_of_the_installed_package(http, url, media_type):
    answer = http.get(url)
    assert answer.headers["content-type"].startswith(media_type)
    assert answer.headers["content-encoding"] == "gzip"
    assert "immutable" in answer.headers["cache-control"]
    assert b"swagger-ui" in answer.content
    plain = http.get(url, headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert plain.content == answer.content
    assert len(gzip.compress(answer.content, 6)) < 1_000_000


def test_there_is_one_viewer(http):
    for path in ("/redoc", "/docs/oauth2-redirect"):
        assert http.get(path).status_code == 404
