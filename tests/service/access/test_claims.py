"""Whose a source is: what one token posts as cannot be feigned by another."""

import time
from datetime import UTC, datetime, timedelta

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import delete

from service.access import tokens
from service.access.tokens import TokenSpec
from service.app import create_app
from service.cameras.sources import watch_sources
from service.job_queue import JobQueue
from service.store import references, sources
from service.store.engines.store import Store
from service.store.tracks import TrackRecord
from tests.conftest import CAMERA, track
from tests.service.conftest import problem
from tests.service.street import KNOCKED, PRIOR, Street


class Site:
    """The camera `corner` with access on, and tokens that post for it."""

    def __init__(self, http, settings):
        self.http = http
        self.settings = settings
        self.store = Store(settings)
        self._texts = {}
        self._posted = 0
        self.token("admin", scopes=("admin",))
        self.http.post("/cameras", json=CAMERA, headers=self.bearer("admin"))

    def token(self, name, scopes=("ingest",), **named):
        with self.store.write() as session:
            made = tokens.make_token(session, TokenSpec(name=name, scopes=scopes, **named), None)
            self._texts[name] = made.text
            return made.record.id

    def revoke(self, name):
        with self.store.write() as session:
            tokens.revoke_token(session, self._texts[name].split("_")[1], None)

    def post(self, name, source="bytetrack-1.2", camera_id="corner"):
        self._posted += 1
        body = {"source": source, "tracks": [track(str(self._posted), time.time() - 60)]}
        url = f"/cameras/{camera_id}/tracks"
        return self.http.post(url, json=body, headers=self.bearer(name))

    def sources(self):
        found = self.http.get("/cameras/corner/sources", headers=self.bearer("admin")).json()
        return {each["name"]: (each["counts"], each["tracks"]) for each in found["items"]}

    def bearer(self, name):
        return {"Authorization": f"Bearer {self._texts[name]}"}


@pytest.fixture
def site(settings):
    on = settings.model_copy(update={"auth": "on"})
    with TestClient(create_app(on)) as http:
        made = Site(http, on)
        yield made
        made.store.close()


def test_a_second_token_does_not_post_under_the_first_ones_name(site):
    """It would turn a knock to `ok` by people of a camera that stands, or feign one."""
    site.token("tracker")
    site.token("liar")
    assert site.post("tracker").status_code == 202
    document = problem(site.post("liar"), 403, "forbidden")
    assert "under what the token of tracker posts" in document["detail"]
    assert site.post("tracker").status_code == 202
    assert site.post("liar", "another").status_code == 202
    problem(site.post("tracker", "another"), 403, "forbidden")
    assert site.sources() == {"bytetrack-1.2": (True, 2), "another": (False, 1)}


@pytest.mark.slow
@pytest.mark.parametrize(("seen", "feigned"), [(KNOCKED, PRIOR), (PRIOR, KNOCKED)])
def test_500_people_of_a_second_token_hide_no_knock_and_feign_none(site, seen, feigned):
    http = site.http
    admin = site.bearer("admin")
    change = {"json": {"reference_tracks": 60}, "headers": {**admin, "If-Match": "*"}}
    http.patch("/cameras/corner", **change).raise_for_status()
    for name in ("tracker", "liar"):
        site.token(name, scopes=("read", "ingest"))
    http.headers.update(site.bearer("tracker"))
    street = Street(http, site.settings)
    street.keep_to_lanes(PRIOR, 60)
    assert street.look()["reference"]["state"] == "ready"
    street.keep_to_lanes(seen, 40)
    told = street.look()
    liar = Street(http, site.settings)
    liar.clock_s = street.clock_s
    http.headers.update(site.bearer("liar"))
    with pytest.raises(KeyError):  # 403: nothing is accepted
        liar.keep_to_lanes(feigned, 500)
    liar.source = "another"
    liar.keep_to_lanes(feigned, 500)
    found = street.look()
    assert found["state"] == told["state"] == ("drifting" if seen is KNOCKED else "ok")
    assert found["drift"] == told["drift"]
    street.close()
    liar.close()


def test_a_name_is_free_once_its_token_is_revoked(site):
    site.token("tracker")
    site.token("after")
    site.post("tracker")
    site.revoke("tracker")
    assert site.post("after").status_code == 202
    assert site.post("after").status_code == 202
    assert site.sources() == {"bytetrack-1.2": (True, 3)}


def test_tokens_that_name_a_source_share_it_and_nobody_else_has_it(site):
    site.token("before")
    assert site.post("before").status_code == 202
    site.token("one", sources=("bytetrack-1.2", "b"))
    site.token("two", sources=("bytetrack-1.2",), cameras=("corner",))
    for name in ("one", "two", "one"):
        assert site.post(name).status_code == 202
    problem(site.post("before"), 403, "forbidden")
    problem(site.post("before", "b"), 403, "forbidden")  # before anybody has posted under it
    document = problem(site.post("two", "b"), 403, "forbidden")
    assert document["detail"] == "source: two posts under bytetrack-1.2, got 'b'"
    assert site.sources() == {"bytetrack-1.2": (True, 4)}


def test_a_camera_that_a_token_names_is_claimed_by_it_alone(site):
    site.token("gate", cameras=("corner",))
    site.token("any")
    document = problem(site.post("any", "fast"), 403, "forbidden")
    assert "the first has to be posted by a token that names the camera" in document["detail"]
    assert site.sources() == {}
    assert site.post("gate").status_code == 202
    assert site.post("any", "fast").status_code == 202
    assert site.sources() == {"bytetrack-1.2": (True, 1), "fast": (False, 1)}


@pytest.mark.parametrize(("cameras", "counts"), [(None, "bytetrack-1.2"), (("corner",), "next")])
def test_a_silent_source_is_followed_by_who_may_claim_the_camera(site, cameras, counts):
    site.token("gate", cameras=("corner",))
    site.post("gate")
    site.token("later", cameras=cameras)
    site.post("later", "next")
    with site.store.write() as session:
        old = sources.find(session, "corner", "bytetrack-1.2")
        session.execute(delete(TrackRecord).where(TrackRecord.source == old.name))
        old.last_seen_at -= timedelta(days=8)
        queue = JobQueue(site.store.engine)
        watch_sources(session, queue, site.settings, "corner", datetime.now(UTC))
        assert references.newest(session, "corner").source == counts


def test_a_source_of_when_access_was_off_is_the_tokens_that_posts_next(settings, corner):
    body = {"source": "bytetrack-1.2", "tracks": [track("1", time.time() - 60)]}
    assert corner.post("/cameras/corner/tracks", json=body).status_code == 202
    on = settings.model_copy(update={"auth": "on"})
    with TestClient(create_app(on)) as http:
        site = Site(http, on)
        token_id = site.token("tracker")
        site.token("liar")
        assert site.post("tracker").status_code == 202
        problem(site.post("liar"), 403, "forbidden")
        with site.store.read() as session:
            assert sources.find(session, "corner", "bytetrack-1.2").token_id == token_id
        site.store.close()


@pytest.mark.parametrize(
    "named", [{"sources": []}, {"sources": ["a\nb"]}, {"scopes": ["read"], "sources": ["s"]}]
)
def test_sources_are_named_for_posting_alone(site, named):
    body = {"name": "x", "scopes": ["ingest"], **named}
    answer = site.http.post("/tokens", json=body, headers=site.bearer("admin"))
    problem(answer, 422, "malformed")
