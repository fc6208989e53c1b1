"""Addresses and credentials of cameras' images: sealed, never returned, for one host."""

from contextlib import closing

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.cameras import image_source
from service.cameras.image_source import fetch_image
from service.commands.key_rotation import rotate_key
from service.commands.migrate import migrate
from service.data_dir import StartError
from service.notifications.fetch import Credentials, Fetched
from service.notifications.host_backoff import HostBackoff
from service.notifications.keys import require_openable, sealer_of
from service.notifications.webhooks import create_webhook, rotate_secret
from service.store.cameras import CameraRecord
from service.store.engines import files
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.conftest import problem
from tests.service.notifications.test_sealing import SPEC
from tests.stores.databases import only_sqlite

URL = "http://camera.example/now.jpg"
GIVEN = {"user": "viewer", "password": "pass-wörd 1"}
CREDENTIALS = Credentials(**GIVEN)
ANY = {"If-Match": "*"}


@pytest.fixture
def asked(http, settings, monkeypatch):
    """What `fetch` is called with for the camera `corner`."""
    seen = []

    def fetch(_settings, source, _hosts, on_digest, _within_s):
        seen.append((source, on_digest))
        return Fetched(content=b"", media_type="image/jpeg")

    monkeypatch.setattr(image_source, "fetch", fetch)

    def ask(camera_id="corner"):
        with closing(Store(settings)) as store:
            fetch_image(store, settings, camera_id, HostBackoff(10.0))
        return seen[-1]

    return ask


def register(http, camera_id="corner", **more):
    body = {**CAMERA, "id": camera_id, "snapshot_url": URL, "snapshot_credentials": GIVEN, **more}
    answer = http.post("/cameras", json=body)
    assert answer.status_code == 201, answer.text
    return answer


def change(http, **body):
    answer = http.patch("/cameras/corner", json=body, headers=ANY)
    assert answer.status_code == 200, answer.text
    return answer


def test_credentials_are_used_and_never_returned(http, asked):
    answers = [register(http), change(http, name="Gate"), http.get("/cameras/corner")]
    for answer in answers:
        assert answer.json()["snapshot_credentials_set"] is True
        assert "snapshot_credentials" not in answer.json()
        assert "viewer" not in answer.text
        assert "pass-w" not in answer.text
    assert asked()[0].credentials == CREDENTIALS
    assert "pass-w" not in http.get("/activity").text


@only_sqlite("reads the file")
def test_credentials_are_sealed_in_the_database(http, settings):
    register(http)
    content = b"".join(path.read_bytes() for path in settings.data_dir.glob("surefoot.sqlite*"))
    assert b"viewer" not in content
    assert b"pass-w" not in content


@pytest.mark.parametrize(
    ("url", "stay"),
    [
        ("http://camera.example/other.jpg?x=1", True),
        ("http://camera.example:81/now.jpg", False),
        ("https://camera.example/now.jpg", False),
        ("http://thief.example/now.jpg", False),
        ("", False),
    ],
)
def test_credentials_stay_with_their_host(http, asked, url, stay):
    register(http)
    assert change(http, snapshot_url=url).json()["snapshot_credentials_set"] is stay
    if url:
        assert asked()[0].credentials == (CREDENTIALS if stay else None)


def test_credentials_are_changed_and_deleted(http, asked):
    register(http)
    change(http, snapshot_credentials={"user": "ada", "password": "other"})
    assert asked()[0].credentials == Credentials(user="ada", password="other")
    gone = change(http, snapshot_credentials="").json()
    assert (gone["snapshot_credentials_set"], gone["snapshot_url"]) == (False, URL)
    assert asked()[0].credentials is None


def test_host_that_asked_for_digest_stays_with_it(http, asked):
    register(http)
    register(http, "second", snapshot_url=f"{URL}?channel=2")
    register(http, "elsewhere", snapshot_url="http://other.example/now.jpg")
    source, on_digest = asked()
    assert not source.digest_only
    on_digest()
    # The same host by another camera, too; and another password changes nothing.
    change(http, snapshot_credentials={"user": "ada", "password": "other"})
    assert [asked(each)[0].digest_only for each in ("corner", "second", "elsewhere")] == [
        True,
        True,
        False,
    ]
    change(http, snapshot_url="")
    change(http, snapshot_url=URL, snapshot_credentials=GIVEN)
    assert not asked()[0].digest_only


def test_credentials_without_an_address_are_rejected(http):
    body = {**CAMERA, "snapshot_credentials": GIVEN}
    document = problem(http.post("/cameras", json=body), 422, "malformed")
    assert document["detail"] == "snapshot_credentials: a snapshot_url is needed, got none"


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"user": "viewer", "password": "seecret" * 40}, "1 to 200 characters are needed, got 280"),
        ({"user": "seecret:x", "password": "y"}, "a user without a colon"),
        ({"user": "viewer", "password": "seecret\n"}, "printable characters"),
        ({"user": "", "password": "seecret"}, "1 to 200 characters are needed, got 0"),
        ({"password": "seecret"}, "is required"),
        ("seecret", ""),
    ],
)
def test_error_about_credentials_does_not_repeat_them(http, given, reason):
    register(http)
    for answer in (
        http.post("/cameras", json={**CAMERA, "snapshot_url": URL, "snapshot_credentials": given}),
        http.patch("/cameras/corner", json={"snapshot_credentials": given}, headers=ANY),
    ):
        document = problem(answer, 422, "malformed")
        assert reason in document["detail"]
        assert "snapshot_credentials" in document["errors"][0]["pointer"]
        assert "seecret" not in answer.text


def test_address_that_was_changed_in_the_database_gets_no_credentials(http, settings, asked):
    register(http)
    with closing(Store(settings)) as store, store.write() as session:
        session.get_one(CameraRecord, "corner").snapshot_url = "http://thief.example/now.jpg"
    assert asked()[0].credentials is None


def test_key_opens_and_rotates_credentials(http, settings, asked):
    register(http)
    assert rotate_key(settings, None) == 1
    assert asked()[0].credentials == CREDENTIALS
    path = settings.data_dir / "secret.key"
    path.unlink()
    with pytest.raises(StartError, match=r"secret.key is missing, and 1 stored secrets"):
        migrate(settings)
    assert rotate_key(settings, None, lost=True) == 1
    migrate(settings)
    assert asked()[0].credentials is None


@only_sqlite("reads the file")
def test_secrets_of_a_file_are_those_that_the_key_seals(http, settings):
    register(http)
    with closing(Store(settings)) as store, store.write() as session:
        hook = create_webhook(session, settings, SPEC)
        rotate_secret(session, settings, hook.record.id)
    found = files.sealed_secrets(settings.database_path)
    name = f"webhook {hook.record.id}"
    assert [purpose for purpose, _ in found] == [name, name, "camera corner"]
    require_openable(sealer_of(settings), found)


def test_nothing_was_sealed_for_another_camera(http, settings, asked):
    """A row that was copied to another camera does not open."""
    register(http)
    register(http, "second", snapshot_credentials=None)
    with closing(Store(settings)) as store, store.write() as session:
        first = session.get_one(CameraRecord, "corner")
        session.get_one(CameraRecord, "second").snapshot_credentials = first.snapshot_credentials
    with pytest.raises(image_source.FetchError, match="does not open the stored secrets"):
        asked("second")


def test_service_starts_again_with_credentials(http, settings):
    register(http)
    migrate(settings)
    with TestClient(create_app(settings)) as again:
        assert again.get("/cameras/corner").json()["snapshot_credentials_set"] is True
