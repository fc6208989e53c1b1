"""The registration form: what is typed, pasted and uploaded, and what is said of it."""

import math

import cv2
import numpy as np
import pytest

from models.geometry.ground import pixel_from_ground, walking_speed
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from tests.conftest import CAMERA
from tests.service.conftest import problem

# The Town Centre camera of `tests/models/geometry/test_conventions.py`, in both forms.
LENS = {
    "width": "1920", "height": "1080", "fx": "2696.36", "cx": "959.5", "cy": "539.5",
    "distortion": "-0.60, 4.70, -0.0005, -0.0078, 0",
}  # fmt: skip
ANGLES = {"height_m": "7.844", "tilt_deg": "20.04", "roll_deg": "1.44", "heading_deg": "61.92"}
POSE = CameraPose(
    height_m=7.844,
    tilt_rad=math.radians(20.04),
    roll_rad=math.radians(1.44),
    heading_rad=math.radians(61.92),
    x_m=-9.04,
    y_m=-5.0,
)


def matrix_form(pose=POSE):
    rows = "\n".join(str(row.tolist()) for row in pose.rotation)
    return {"form": "matrix", "rotation": rows, "translation_m": str(pose.translation_m.tolist())}


def preview(http, tracks=(), **fields):
    answer = http.post("/ui/preview", json={"fields": fields, "tracks": list(tracks)})
    assert answer.status_code == 200, answer.text
    return answer.json()


def kinds(shown):
    return [said["kind"] for said in shown["says"]]


def walks(speed_mps=1.3, rate_hz=25.0, count=6, pose=POSE):
    """Recorded tracks [frame, u, v] of people who walk across at a speed."""
    lens = Intrinsics(width=1920, height=1080, fx=2696.36, fy=2696.36, cx=959.5, cy=539.5)
    ahead = np.array([math.sin(pose.heading_rad), math.cos(pose.heading_rad)])
    frames = np.arange(0, 150, 5.0)
    found = []
    for n in range(count):
        start = pose.centre_m[:2] + (18 + n) * ahead + (n - 2.5) * np.array([ahead[1], -ahead[0]])
        ground = start + np.outer(frames / rate_hz * speed_mps, -ahead * (-1) ** n)
        uv, valid = pixel_from_ground(lens, pose.rotation, pose.centre_m, ground)
        assert valid.all()
        found.append(np.column_stack([frames, uv]).tolist())
    return found


def test_the_page_has_its_fields(http):
    html = http.get("/ui/register").text
    for name in ("name", "fx", "tilt_deg", "rotation", "frame_rate_hz", "tracks", "file"):
        assert f'id="{name}"' in html
        assert f'for="{name}"' in html


def test_a_form_with_little_in_it_is_not_wrong_yet(http):
    assert preview(http) == {"picture": "", "ground": "", "says": [], "errors": {}}
    assert preview(http, width="1920", tilt_deg="-")["errors"]["tilt_deg"].startswith("a number")


def test_both_forms_draw_the_same(http):
    angles = preview(http, **LENS, **ANGLES, x_m="-9.04", y_m="-5")
    assert angles["picture"].startswith("<svg")
    assert 'class="grid prior" d="M' in angles["picture"]
    assert kinds(angles) == ["info"]
    assert "shows ground only" in angles["says"][0]["text"]
    matrix = preview(http, **LENS, **matrix_form())
    assert matrix["errors"] == {}
    assert matrix["picture"] == angles["picture"]
    assert any("7.84 m high, looking down 20.0°" in said["text"] for said in matrix["says"])


def test_a_wrong_sign_is_seen(http):
    shown = preview(http, **LENS, **{**ANGLES, "tilt_deg": "−20.04"})
    assert 'class="grid' not in shown["picture"]
    assert "nothing but sky" in shown["picture"]
    worst = shown["says"][0]
    assert worst["kind"] == "critical"
    assert "looks up by 20.0°, so there is no ground" in worst["text"]
    assert (worst["field"], worst["value"]) == ("tilt_deg", "20.04")


def test_millimetres_are_seen(http):
    shown = preview(http, **LENS, **{**ANGLES, "height_m": "7844"})
    assert any("millimetres" in said["text"] for said in shown["says"])


def test_a_position_for_t_is_seen(http):
    form = matrix_form()
    form["translation_m"] = str(POSE.centre_m.tolist())
    shown = preview(http, **LENS, **form)
    assert "under the ground" in shown["errors"]["translation_m"]


def test_a_reflection_is_no_rotation(http):
    form = {"form": "matrix", "rotation": "1 0 0 0 1 0 0 0 -1", "translation_m": "0 0 5"}
    assert "reflection" in preview(http, **LENS, **form)["errors"]["rotation"]
    form["rotation"] = "1 2 3 4"
    assert preview(http, **LENS, **form)["errors"]["rotation"] == "9 or 3 numbers are needed, got 4"


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({}, "good", "plausible"),
        ({"height_m": "23.5"}, "critical", "too fast. The height or the frame rate is wrong"),
        ({"frame_rate_hz": "6"}, "critical", "too slow"),
        ({"height_m": "11"}, "warning", "which is fast"),
    ],
)
def test_recorded_people_say_what_the_pose_implies(http, changes, kind, words):
    lens = {**LENS, "distortion": ""}
    fields = {**lens, **ANGLES, "x_m": "-9.04", "y_m": "-5", "frame_rate_hz": "25", **changes}
    shown = preview(http, walks(), **fields)
    assert 'class="track" d="M' in shown["picture"]
    assert 'class="track" d="M' in shown["ground"]
    assert shown["says"][0]["kind"] == kind
    assert words in shown["says"][0]["text"]


def test_people_in_the_sky(http):
    shown = preview(http, walks(), **LENS, **{**ANGLES, "tilt_deg": "-20"})
    assert "looks up" in shown["says"][0]["text"]
    assert "6 of 6 people walk in the sky" in shown["says"][1]["text"]
    assert shown["ground"] == ""


def test_the_speed_on_the_ground():
    lens = Intrinsics(width=1920, height=1080, fx=2696.36, fy=2696.36, cx=959.5, cy=539.5)
    tracks = [(track[:, 0] / 25, track[:, 1:]) for track in map(np.array, walks(1.3))]
    assert walking_speed(lens, POSE, tracks) == pytest.approx(1.3, abs=1e-6)
    time_s, uv = tracks[0]
    standing = [(time_s, np.tile(uv[:1], (len(uv), 1)))] * 20
    assert walking_speed(lens, POSE, [*tracks, *standing]) == pytest.approx(1.3, abs=1e-6)
    assert math.isnan(walking_speed(lens, POSE, standing))
    assert math.isnan(walking_speed(lens, POSE, [(time_s[:3], uv[:3])]))


def test_a_motchallenge_file_is_thinned_and_not_stored(http):
    lines = [f"{frame},7,{900 + frame},{500},60,180,1" for frame in range(0, 200)]
    lines.append("1,9,0,0,10,10,1")
    query = {"width": 1920, "height": 1080, "frame_rate_hz": 25}
    text = {"Content-Type": "text/csv"}
    answer = http.post("/ui/tracks", params=query, content="\n".join(lines), headers=text).json()
    (track,) = answer["tracks"]
    assert len(track) == 40
    assert track[1] == [4.0, 934.0, 679.0]  # counted from 0
    assert answer["text"].startswith("1 track read; 1 left out, the first since: 1 points")
    wrong = http.post("/ui/tracks", params=query, content="hello", headers=text)
    assert wrong.status_code == 422


@pytest.mark.parametrize("ending", [".yml", ".xml", ".json"])
def test_an_opencv_file_fills_the_form(http, ending):
    storage = cv2.FileStorage(ending, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", 1920)
    storage.write("image_height", 1080)
    storage.write("camera_matrix", np.array([[2696.36, 0, 959.5], [0, 2696.5, 539.5], [0, 0, 1]]))
    storage.write("distortion_coefficients", np.array([[-0.6, 4.7, -0.0005, -0.0078]]))
    storage.write("R", POSE.rotation)
    storage.write("t", POSE.translation_m)
    answer = http.post("/ui/calibration", content=storage.releaseAndGetString())
    assert answer.status_code == 200, answer.text
    fields = answer.json()["fields"]
    assert (fields["width"], fields["fy"], fields["form"]) == ("1920", "2696.5", "matrix")
    assert fields["distortion"] == "-0.6, 4.7, -0.0005, -0.0078, 0"
    shown = preview(http, **fields)
    assert any("7.84 m high" in said["text"] for said in shown["says"])


def test_any_other_text_is_refused_in_words(http):
    for text in (
        "",
        "hello",
        "%YAML:1.0\n---\nx: 1\n",
        "{",
        "<opencv_storage>",
        "%YAML:1.0\nK: [1",
    ):
        answer = http.post("/ui/calibration", content=text)
        document = problem(answer, 422, "malformed")
        assert document["errors"][0]["pointer"] == "/file"


def test_a_rational_lens_is_refused_in_words(http):
    """An Azure Kinect's factory calibration: five coefficients are 5.5 px off in its corner."""
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("K", np.array([[975.8, 0, 1020], [0, 975.6, 775], [0, 0, 1]]))
    storage.write("D", np.array([0.5217, -2.7123, 8e-4, -1e-4, 1.5583, 0.3994, -2.5348, 1.4865]))
    document = problem(
        http.post("/ui/calibration", content=storage.releaseAndGetString()), 422, "malformed"
    )
    assert "must be within 3.2 px" in document["detail"]
    assert "CALIB_RATIONAL_MODEL" in document["detail"]


def test_it_is_registered_as_by_the_api(http):
    fields = {**LENS, **ANGLES, "name": "Town Centre", "frame_rate_hz": "25", "roll_deg": "1,44"}
    answer = http.post("/ui/register", json=fields)
    assert answer.status_code == 201, answer.text
    camera = http.get("/cameras/town-centre").json()
    assert camera["prior_pose"]["roll_deg"] == pytest.approx(1.44)
    assert camera["intrinsics"]["fy"] == 2696.36
    assert camera["reference_tracks"] == 200
    assert len(http.get("/cameras/town-centre/trainings").json()["items"]) == 1
    again = http.post("/ui/register", json=fields)
    problem(again, 409, "conflict")


def test_what_is_wrong_is_said_beside_its_field(http):
    fields = {"width": "1920", "fx": "0", "height_m": "six", "id": "Not An Id"}
    document = problem(http.post("/ui/register", json=fields), 422, "malformed")
    reasons = {item["pointer"]: item["reason"] for item in document["errors"]}
    assert reasons["/height"] == "is required"
    assert reasons["/tilt_deg"] == "is required"
    assert reasons["/height_m"].startswith("a number is needed")
    fields = {**LENS, **ANGLES, "fx": "0", "tilt_deg": "95"}
    document = problem(http.post("/ui/register", json=fields), 422, "malformed")
    reasons = {item["pointer"]: item["reason"] for item in document["errors"]}
    assert reasons == {
        "/fx": "must be at least 1 (got 0)",
        "/tilt_deg": "must be at most 90 (got 95)",
    }
    fields = {**LENS, **ANGLES, "id": "Not An Id"}
    document = problem(http.post("/ui/register", json=fields), 422, "malformed")
    assert document["errors"][0]["pointer"] == "/id"
    assert http.get("/cameras").json()["items"] == []


def test_the_api_takes_what_it_took(http):
    assert http.post("/cameras", json=CAMERA).status_code == 201


@pytest.mark.parametrize(
    ("changes", "reasons"),
    [
        ({"fx": ""}, {"/fx": "is required"}),
        ({"fx": "0"}, {"/fx": "must be at least 1 (got 0)"}),  # and nothing of fy, which is fx
        ({"fx": "1e7", "fy": "9e6"}, {
            "/fx": "must be at most 1000000 (got 10000000)",
            "/fy": "must be at most 1000000 (got 9000000)"}),
        ({"width": "1920,5"}, {"/width": "must be a whole number (got 1920.5)"}),
        ({"height": "0"}, {"/height": "must be more than 0 (got 0)"}),
        ({"cx": "nan"}, {"/cx": "a number is needed, got 'nan'"}),
        ({"roll_deg": "x" * 99}, {"/roll_deg": f"a number is needed, got '{'x' * 30}'"}),
        ({"distortion": "1 2 3 4 5 6"}, {
            "/distortion": "1 or 2 or 3 or 4 or 5 numbers are needed, got 6"}),
        ({"height_m": "-2"}, {"/height_m": "must be above 0, got -2.0"}),
        ({"height_m": "20000"}, {"/height_m": "at most 10000 m are taken, got 20000"}),
        ({"x_m": "1e9"}, {"/x_m": "at most 1e+08 m are taken, got 1e+09"}),
        ({"name": "n" * 201}, {
            "/name": f"must have at most 200 characters (got '{'n' * 37}...{'n' * 38}')"}),
        ({"id": "Not An Id"}, {
            "/id": "may have only lower-case letters, digits and hyphens (got 'Not An Id')"}),
        ({"frame_rate_hz": "0"}, {"/frame_rate_hz": "must be more than 0 (got 0)"}),
        ({"reference_tracks": "4"}, {"/reference_tracks": "must be at least 5 (got 4)"}),
        ({"form": "matrix", "rotation": "1 2"}, {
            "/rotation": "9 or 3 numbers are needed, got 2", "/translation_m": "is required"}),
        ({"form": "matrix", "rotation": "0 0 0", "translation_m": "0, 0, 3"}, {
            "/translation_m": "R and t put the camera under the ground (height -3.0 m): R has to "
            "turn world into camera axes, and t is not the position but \N{MINUS SIGN}R times it"}),
        ({"form": "matrix", "rotation": "[1.5707963, 0, 0]", "translation_m": "(2e9; 9; 0)"},
         {"/translation_m": "at most 1e+08 m are taken, got -2e+09"}),
    ],
)  # fmt: skip
def test_each_reason_names_its_field_its_limit_and_what_was_typed(http, changes, reasons):
    fields = {**LENS, **ANGLES, **changes}
    document = problem(http.post("/ui/register", json=fields), 422, "malformed")
    assert {item["pointer"]: item["reason"] for item in document["errors"]} == reasons
    shown = preview(http, **fields)["errors"]
    typed = {pointer[1:]: reason for pointer, reason in reasons.items() if reason != "is required"}
    assert shown == typed
    assert http.get("/cameras").json()["items"] == []


def test_numbers_are_read_as_they_are_typed(http):
    fields = {**LENS, **ANGLES, "width": " 1.92e3 ", "tilt_deg": "\N{MINUS SIGN}3,5°",
              "cx": "", "cy": "", "distortion": "[0.5; 1]", "id": "typed"}  # fmt: skip
    answer = http.post("/ui/register", json=fields)
    assert answer.status_code == 201, answer.text
    body = answer.json()
    assert body["prior_pose"]["tilt_deg"] == pytest.approx(-3.5)
    lens = body["intrinsics"]
    assert (lens["width"], lens["fy"], lens["cx"], lens["cy"]) == (1920, 2696.36, 959.5, 539.5)
    assert lens["distortion"] == [0.5, 1, 0, 0, 0]
