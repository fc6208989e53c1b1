"""A camera's still image: off unless switched on, made anew, gone with its camera."""

from datetime import UTC, datetime, timedelta
from io import BytesIO

import pytest
from fastapi.testclient import TestClient
from PIL import Image

from service.app import create_app
from service.formats import confined
from service.formats.still import read_still
from service.store import cameras, pictures
from service.store.cameras import CameraRecord, DueImage, SnapshotRecord
from service.store.engines.store import Store
from service.store.pictures import PictureReferenceRecord
from tests.conftest import CAMERA
from tests.service.conftest import problem

URL = "/cameras/corner/snapshot"
JPEG, PNG = {"Content-Type": "image/jpeg"}, {"Content-Type": "image/png"}


def image(width=1280, height=720, form="JPEG", mode="RGB", **how):
    made = BytesIO()
    Image.new(mode, (width, height), "gray").save(made, form, **how)
    return made.getvalue()


@pytest.fixture
def allowed(settings):
    with TestClient(
        create_app(settings.model_copy(update={"snapshots": "pictures", "http_wait_s": 1}))
    ) as client:
        assert client.post("/cameras", json=CAMERA).status_code == 201
        yield client


def test_no_picture_is_kept_unless_it_is_switched_on(corner):
    document = problem(corner.put(URL, content=image(), headers=JPEG), 403, "switched_off")
    assert "SUREFOOT_SNAPSHOTS" in document["detail"]
    problem(corner.get(URL), 403, "switched_off")
    problem(corner.delete(URL), 404, "not_found")


def test_a_picture_is_kept_without_what_was_beside_it(allowed):
    exif = Image.Exif()
    exif[0x010E] = "a place and a name"
    sent = image(2560, 1440, exif=exif, comment=b"a comment")
    assert b"a place and a name" in sent
    body = allowed.put(URL, content=sent, headers=JPEG).json()
    assert (body["width"], body["height"]) == (1920, 1080)
    answer = allowed.get(URL)
    assert answer.headers["content-type"] == "image/jpeg"
    assert b"a place and a name" not in answer.content
    assert b"a comment" not in answer.content
    assert dict(Image.open(BytesIO(answer.content)).getexif()) == {}
    again = allowed.get(URL, headers={"If-None-Match": answer.headers["ETag"]})
    assert again.status_code == 304


def test_a_png_with_holes_becomes_a_jpeg_and_takes_the_place_of_the_one_before(allowed):
    allowed.put(URL, content=image(), headers=JPEG).raise_for_status()
    made = BytesIO()
    Image.new("RGBA", (640, 360), (0, 0, 0, 0)).save(made, "PNG")
    allowed.put(URL, content=made.getvalue(), headers=PNG).raise_for_status()
    kept = Image.open(BytesIO(allowed.get(URL).content))
    assert (kept.format, kept.size) == ("JPEG", (640, 360))


@pytest.mark.parametrize(
    ("content", "headers", "status", "code"),
    [
        (b"", JPEG, 422, "malformed"),
        (b"\xff\xd8\xff nothing", JPEG, 422, "malformed"),
        (image()[:-900], JPEG, 422, "malformed"),
        (image(form="PNG"), JPEG, 422, "malformed"),
        (image(), {"Content-Type": "image/gif"}, 415, "unsupported_media_type"),
        (image(), {"Content-Type": ""}, 415, "unsupported_media_type"),
        (image(720, 1280), JPEG, 422, "malformed"),
        (b"\xff" * (8 * 1024 * 1024 + 1), JPEG, 413, "too_large"),
        (image(9000, 5700, form="PNG", mode="1"), PNG, 413, "too_large"),
    ],
)
def test_what_is_no_picture_of_the_camera_is_refused(allowed, content, headers, status, code):
    problem(allowed.put(URL, content=content, headers=headers), status, code)
    problem(allowed.get(URL), 404, "not_found")


def scans(width, height, count):
    """A progressive JPEG whose last scan comes again and again: small, and dear to read."""
    data = image(width, height, mode="L", progressive=True)
    last = data.rindex(b"\xff\xda")
    return data[:-2] + data[last:-2] * count + data[-2:]


def test_no_refusal_names_an_object_of_python(allowed):
    headers = {"Content-Type": "image/png"}
    said = problem(allowed.put(URL, content=b"GIF89a", headers=headers), 422, "malformed")
    assert said["detail"] == "body: not a PNG image"


def test_thousands_of_scans_cost_a_reader_its_limit_and_hold_up_nobody(allowed, monkeypatch):
    """12,000 of them, 1 MB of 49 million pixels, held all large bodies for a minute and a half."""
    monkeypatch.setattr(confined, "MAX_CPU_S", 1)
    assert read_still(scans(64, 36, 12_000), "image/jpeg").width == 64
    document = problem(
        allowed.put(URL, content=scans(2560, 1440, 12_000), headers=JPEG), 422, "malformed"
    )
    assert document["detail"] == "body: reading it takes more than 1 s of a CPU"
    problem(allowed.get(URL), 404, "not_found")
    assert allowed.put(URL, content=image(), headers=JPEG).status_code == 200


def test_a_picture_takes_no_turn_of_large_bodies(allowed):
    with allowed.app_state["app"].large_bodies.turn(0):
        assert allowed.put(URL, content=image(), headers=JPEG).status_code == 200
    with allowed.app_state["app"].stills.turn(0):
        document = problem(allowed.put(URL, content=image(), headers=JPEG), 503, "overloaded")
    assert "still images" in document["detail"]


def test_a_picture_of_every_kind_is_read_without_another_file(allowed):
    """What the library imports only for some is imported before the reader gives up its rights."""
    turned = Image.Exif()
    turned[0x0112] = 6
    kinds = [
        (image(720, 1280, exif=turned), JPEG),
        (image(mode="L", progressive=True), JPEG),
        (image(mode="CMYK"), JPEG),
        (image(form="PNG", mode="P"), PNG),
        (image(form="PNG", mode="I;16"), PNG),
        (image(720, 1280, form="PNG", exif=turned), PNG),
    ]
    for content, headers in kinds:
        assert allowed.put(URL, content=content, headers=headers).status_code == 200
        kept = Image.open(BytesIO(allowed.get(URL).content))
        assert (kept.format, kept.mode, kept.size) == ("JPEG", "RGB", (1280, 720))


def test_a_picture_goes_when_it_is_deleted_and_with_its_camera(allowed, settings):
    allowed.put(URL, content=image(), headers=JPEG).raise_for_status()
    assert allowed.delete(URL).status_code == 204
    problem(allowed.get(URL), 404, "not_found")
    allowed.put(URL, content=image(), headers=JPEG).raise_for_status()
    allowed.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    with Store(settings).read() as session:
        assert session.get(SnapshotRecord, "corner") is None
    problem(allowed.put(URL, content=image(), headers=JPEG), 404, "not_found")


def test_a_picture_of_the_future_gives_way_and_the_next_is_due(allowed, settings):
    """They are of before the clock was set back by a month."""
    ahead, every = timedelta(days=30), timedelta(hours=1)
    assert allowed.put(URL, content=image(), headers=JPEG).status_code == 200
    store = Store(settings)
    with store.write() as session:
        kept, now = session.get(SnapshotRecord, "corner"), datetime.now(UTC)
        kept.taken_at, kept.stored_at = kept.taken_at + ahead, kept.stored_at + ahead
        camera = session.get(CameraRecord, "corner")
        camera.snapshot_url, camera.snapshot_due_at = "http://10.0.0.1/", now + every
        assert cameras.snapshots_due(session, now, every) == []
        camera.snapshot_due_at = now + ahead
        (due,) = cameras.snapshots_due(session, now, every)
        assert due == DueImage(camera_id="corner", url="http://10.0.0.1/", answers=True)
    assert allowed.put(URL, content=image(), headers=JPEG).status_code == 200


def test_features_without_an_image_are_deleted(corner, settings):
    with Store(settings).write() as session:
        prior_id = cameras.prior_pose(session, "corner").id
        session.add(
            PictureReferenceRecord(camera_id="corner", prior_pose_id=prior_id, features=b"kept")
        )
    assert corner.delete(URL).status_code == 204
    with Store(settings).read() as session:
        assert pictures.gallery(session, prior_id) == []
    problem(corner.delete(URL), 404, "not_found")
