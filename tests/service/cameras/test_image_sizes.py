"""Tracks in the numbers of another image are asked about before a reference is learned."""

import json

import numpy as np
import pytest
from sqlalchemy import select

from service.store.tracks import TrackRecord, unpack
from tests.conftest import CAMERA, SCENES
from tests.service.conftest import problem
from tests.service.street import LENS, PRIOR, Street

URL = "/cameras/corner"
FIELD = SCENES.parent / "field"
WANTED = 40
FRAME = (1280, 720)
STREAMS = [
    pytest.param("shares", "image_shares", {"tracks_normalised": True}, id="shares"),
    pytest.param((320, 180), "other_image_size", {"tracks_size": [320, 180]}, id="320x180"),
    pytest.param((427, 240), "other_image_size", {"tracks_size": [427, 240]}, id="427x240"),
    pytest.param((2560, 1440), "other_image_size", {"tracks_size": [2560, 1440]}, id="2560x1440"),
]


class Stream(Street):
    """A street whose tracker posts the numbers of another image than the camera's frame."""

    image: str | tuple[int, int] = FRAME
    stated: dict = {}

    def _post(self):
        for body in self._bodies:
            body["points"] = [[row[0], *self.posted(row[1:])] for row in body["points"]]
            body.update(self.stated)
        super()._post()

    def posted(self, uv):
        shift = 0.0 if self.image == "shares" else 0.5
        width, height = (1, 1) if self.image == "shares" else self.image
        return [
            (uv[0] + 0.5) * width / FRAME[0] - shift,
            (uv[1] + 0.5) * height / FRAME[1] - shift,
        ]

    def change(self, body):
        etag = self.http.get(URL).headers["ETag"]
        return self.http.patch(URL, json=body, headers={"If-Match": etag})

    def feet(self):
        """The stored feet of each track by its id."""
        with self.context.store.read() as session:
            records = session.scalars(select(TrackRecord).order_by(TrackRecord.id)).all()
        return {record.track_id: unpack(record.points, 3)[:, 1:] for record in records}

    def feet_are_right(self):
        feet = self.feet()
        assert len(feet) == len(self.seen)
        for number, seen in enumerate(self.seen):
            np.testing.assert_allclose(feet[str(number)], seen.uv, atol=1e-6)


def stream(http, settings, image, **camera):
    body = {**CAMERA, "reference_tracks": WANTED, **camera}
    http.post("/cameras", json=body).raise_for_status()
    street = Stream(http, settings)
    street.image = image
    return street


@pytest.mark.parametrize(("image", "code", "fix"), STREAMS)
def test_tracks_of_another_image_are_held_until_they_are_rescaled(http, settings, image, code, fix):
    street = stream(http, settings, image)
    street.keep_to_lanes(PRIOR, WANTED + 10)
    held = street.look()
    assert (held["state"], held["reason_code"]) == ("learning", code)
    assert held["reference"]["state"] == "learning"
    assert held["sd"] is None
    assert held["pose"]["tilt_deg"] == pytest.approx(22.0)
    (question,) = held["questions"]
    assert question["fixes"][0] == fix
    assert question["keep"] == {"tracks_size": [1280, 720]}

    assert street.change(fix).status_code == 200
    answered = street.pose()
    assert answered["questions"] == []
    assert answered["reason_code"] == "reference_tracks"
    street.feet_are_right()

    found = street.look()
    assert (found["state"], found["reference"]["state"]) == ("ok", "ready")
    assert found["reference"]["walking_speed_mps"] == pytest.approx(1.3, abs=0.15)
    assert abs(found["drift"]["tilt_deg"] or 0.0) < 0.5
    assert street.alerts() == []


@pytest.mark.skipif(not FIELD.is_dir(), reason="field inputs are not at hand")
def test_question_is_asked_from_the_first_track_on(http, settings):
    street = stream(http, settings, "shares")
    body = json.loads((FIELD / "shares_unsaid.json").read_text())
    assert http.post(f"{URL}/tracks", json=body).json()["accepted"] == 1
    held = street.look()
    assert (held["state"], held["reason_code"]) == ("learning", "image_shares")
    assert held["reason_values"] == {"tracks": 1, "largest_px": 0.59}
    street.change(held["questions"][0]["fixes"][0]).raise_for_status()
    np.testing.assert_allclose(street.feet()["1"][0], [0.2 * 1280 - 0.5, 359.5])
    assert street.look()["reason_code"] == "reference_tracks"


def test_later_posts_are_rescaled_unless_they_state_their_size(http, settings):
    street = stream(http, settings, "shares")
    street.keep_to_lanes(PRIOR, 8)
    assert street.look()["reason_code"] == "image_shares"
    street.change({"tracks_normalised": True}).raise_for_status()
    street.keep_to_lanes(PRIOR, 4)
    street.image, street.stated = (640, 360), {"size": [640, 360]}
    street.keep_to_lanes(PRIOR, 4)
    street.feet_are_right()
    street.change({"tracks_size": [1280, 720]}).raise_for_status()
    feet = street.feet()
    np.testing.assert_allclose(feet["15"], street.seen[15].uv, atol=1e-6)
    assert feet["0"].max() < 1.0  # as it was posted


def test_answer_that_the_numbers_are_right_ends_the_question(http, settings):
    street = stream(http, settings, "shares")
    street.keep_to_lanes(PRIOR, WANTED + 10)
    before = street.look()
    assert before["reason_code"] == "image_shares"
    shares = street.feet()
    street.change(before["questions"][0]["keep"]).raise_for_status()
    assert http.get(URL).json()["tracks_size"] == [1280, 720]
    after = street.look()
    assert after["questions"] == []
    assert after["reason_code"] != "image_shares"
    for track_id, uv in street.feet().items():
        np.testing.assert_array_equal(uv, shares[track_id])


@pytest.mark.parametrize(
    ("image", "stated"),
    [(FRAME, {}), (FRAME, {"size": [1280, 720]}), ("shares", {"normalised": True})],
)
def test_right_or_stated_numbers_raise_no_question(http, settings, image, stated):
    street = stream(http, settings, image)
    street.stated = stated
    street.keep_to_lanes(PRIOR, WANTED + 10)
    assert street.look()["questions"] == []
    assert street.pose()["state"] == "ok"
    street.feet_are_right()


def test_rescaling_a_ready_reference_learns_it_anew(http, settings):
    street = stream(http, settings, "shares")
    street.keep_to_lanes(PRIOR, WANTED + 10)
    street.change({"tracks_size": [1280, 720]}).raise_for_status()
    street.look()
    street.change({"tracks_normalised": True}).raise_for_status()
    assert street.pose()["reference"]["state"] == "learning"
    street.feet_are_right()
    assert street.look()["state"] == "ok"
    (ended,) = street.alerts()
    assert (ended["state"], ended["outcome"]) == ("resolved", "relearned")


def test_shares_in_a_text_that_counts_pixels_from_one_are_rescaled(http, settings):
    http.post("/cameras", json=CAMERA).raise_for_status()
    street = Stream(http, settings)
    lines = [
        f"{frame},{person + 1},{0.2 + 0.004 * frame:.4f},0.5,0.05,0.25,1"
        for person in range(6)
        for frame in range(1, 60)
    ]
    query = {"frame_rate_hz": 10, "started_at": "2026-11-01T08:00:00Z"}
    answer = http.post(
        f"{URL}/tracks",
        params=query,
        content="\n".join(lines),
        headers={"Content-Type": "text/csv"},
    )
    assert answer.json()["accepted"] == 6, answer.text
    assert street.look()["reason_code"] == "image_shares"
    street.change({"tracks_normalised": True}).raise_for_status()
    # The foot is the middle of the lower edge: (0.204 + 0.025) of the width, 0.75 of the height.
    np.testing.assert_allclose(street.feet()["1"][0], [0.229 * 1280 - 0.5, 539.5], atol=1e-6)


def test_sources_have_image_sizes_of_their_own(http, settings):
    street = stream(http, settings, "shares")
    street.source = "yolo"
    street.keep_to_lanes(PRIOR, 8)
    street.change({"tracks_normalised": True}).raise_for_status()
    street.source, street.image = "other", FRAME
    street.keep_to_lanes(PRIOR, 8)
    street.feet_are_right()
    found = {each["name"]: each for each in http.get(f"{URL}/sources").json()["items"]}
    assert (found["yolo"]["size"], found["yolo"]["normalised"]) == (None, True)
    assert (found["other"]["size"], found["other"]["normalised"]) == (None, False)
    http.post(f"{URL}/sources/other/use").raise_for_status()
    assert http.get(URL).json()["tracks_normalised"] is False
    http.delete(f"{URL}/sources/yolo")
    street.source, street.image = "yolo", FRAME
    street.keep_to_lanes(PRIOR, 1)
    np.testing.assert_allclose(street.feet()["16"], street.seen[16].uv, atol=1e-6)


def test_shares_propose_no_pose_for_a_camera_without_one(http, settings):
    body = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    http.post("/cameras", json={**body, "reference_tracks": WANTED}).raise_for_status()
    street = Stream(http, settings)
    street.image = "shares"
    street.keep_to_lanes(PRIOR, WANTED + 10)
    held = street.look()
    assert (held["state"], held["reason_code"]) == ("uncalibrated", "image_shares")
    assert held["proposed"] is None
    street.change(held["questions"][0]["fixes"][0]).raise_for_status()
    found = street.look()
    assert found["questions"] == []
    assert found["proposed"]["pose"]["tilt_deg"] == pytest.approx(22.0, abs=3.0)


def test_confirmed_frame_size_is_forgotten_with_the_frame(http, settings):
    street = stream(http, settings, "shares")
    street.keep_to_lanes(PRIOR, 8)
    street.change({"tracks_size": [1280, 720]}).raise_for_status()
    larger = {**CAMERA["intrinsics"], "width": 1920, "height": 1080}
    changed = street.change({"intrinsics": larger}).json()
    assert (changed["tracks_size"], changed["tracks_normalised"]) == (None, False)


def test_image_size_needs_tracks_and_one_form(corner):
    etag = {"If-Match": corner.get(URL).headers["ETag"]}
    size = {"tracks_size": [640, 360]}
    early = problem(corner.patch(URL, json=size, headers=etag), 409, "conflict")
    assert "the camera has no tracks yet" in early["detail"]
    both = {**size, "tracks_normalised": True}
    problem(corner.patch(URL, json=both, headers=etag), 422, "malformed")
    problem(corner.patch(URL, json={"tracks_size": [0, 360]}, headers=etag), 422, "malformed")


def test_page_asks_and_offers_the_fixes(http, settings):
    street = stream(http, settings, (320, 180))
    street.keep_to_lanes(PRIOR, WANTED + 10)
    street.look()
    page = http.get("/ui/cameras/corner").text
    assert "Are the tracks in pixels of a 320 x 180 image?" in page
    assert 'data-change="{&#34;tracks_size&#34;: [320, 180]}"' in page
    assert "Yes, rescale from 320 x 180" in page
    assert 'data-change="{&#34;tracks_size&#34;: [1280, 720]}"' in page
    assert "No, keep 1280 x 720 pixels" in page
    assert "a question about its tracks is open" in http.get("/").text
    street.change({"tracks_size": [320, 180]}).raise_for_status()
    assert "Are the tracks in pixels" not in http.get("/ui/cameras/corner").text


assert (LENS.width, LENS.height) == FRAME
