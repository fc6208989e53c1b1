"""Lenses as installers know them, and questions about slips of the pen."""

import math

import pytest

from tests.conftest import CAMERA
from tests.service.cameras.test_registration import ANGLES, preview
from tests.service.conftest import problem

SIZE = {"width": 1920, "height": 1080}
POSE = {"height_m": 7.84, "tilt_deg": 20.0}


def registered(http, lens, **others):
    body = {"lens": {**SIZE, **lens}, "prior_pose": POSE, **others}
    answer = http.post("/cameras", json=body)
    assert answer.status_code == 201, answer.text
    return answer.json()


def focal_px(camera):
    lens = camera["intrinsics"]
    assert lens["fx"] == lens["fy"]
    assert (lens["cx"], lens["cy"], lens["distortion"]) == (959.5, 539.5, [0.0] * 5)
    return lens["fx"]


def test_a_field_of_view_is_a_focal_length(http):
    """Pin: 90 deg is as far ahead as half the picture is wide."""
    camera = registered(http, {"hfov_deg": 90.0})
    assert focal_px(camera) == pytest.approx(960.0)
    assert camera["questions"] == []


def test_millimetres_are_told_by_the_sensor(http):
    """Pin: 4 mm before 5.76 mm of 1920 pixels, 0.003 mm each, are 1333.3 pixels."""
    exact = registered(http, {"focal_mm": 4.0, "sensor_mm": [5.76, 3.24]})
    assert focal_px(exact) == pytest.approx(4.0 / 0.003)
    # A sensor of 4:3 gives 16:9 by its whole width.
    cut = registered(http, {"focal_mm": 4.0, "sensor_mm": [5.76, 4.32]})
    assert focal_px(cut) == pytest.approx(4.0 / 0.003)


@pytest.mark.parametrize(
    "lens",
    [
        {},
        {"focal_mm": 4.0},
        {"hfov_deg": 90.0, "focal_mm": 4.0, "sensor_mm": [5.76, 3.24]},
        {"hfov_deg": 180.0},
        {"focal_mm": 4.0, "sensor_mm": [5.76]},
    ],
)
def test_a_lens_is_told_in_one_way(http, lens):
    body = {"lens": {**SIZE, **lens}, "prior_pose": POSE}
    told = problem(http.post("/cameras", json=body), 422, "malformed")
    assert told["errors"][0]["pointer"].startswith("/lens")


def test_a_camera_has_one_lens(http):
    neither = problem(http.post("/cameras", json={"prior_pose": POSE}), 422, "malformed")
    assert "intrinsics or lens is needed" in neither["detail"]
    both = {**CAMERA, "lens": {**SIZE, "hfov_deg": 90.0}}
    assert "got both" in problem(http.post("/cameras", json=both), 422, "malformed")["detail"]


def test_a_lens_is_changed_as_it_was_told(http):
    made = registered(http, {"hfov_deg": 90.0}, id="c")
    etag = http.get("/cameras/c").headers["etag"]
    change = {"lens": {**SIZE, "hfov_deg": 60.0}}
    answer = http.patch("/cameras/c", json=change, headers={"If-Match": etag})
    assert focal_px(answer.json()) == pytest.approx(960 / math.tan(math.radians(30)))
    assert made["intrinsics"] != answer.json()["intrinsics"]


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"intrinsics": {**CAMERA["intrinsics"], "fx": 8, "fy": 8}}, "fx", "millimetres"),
        ({"prior_pose": {"height_m": 784.0, "tilt_deg": 20.0}}, "height_m", "centimetres"),
        ({"prior_pose": {"height_m": 7840.0, "tilt_deg": 20.0}}, "height_m", "millimetres"),
        ({"prior_pose": {"height_m": 7.84, "tilt_deg": -20.0}}, "tilt_deg", "sign"),
    ],
)
def test_what_may_be_a_slip_is_asked_and_stored(http, changes, field, words):
    answer = http.post("/cameras", json={**CAMERA, **changes})
    assert answer.status_code == 201
    asked = {each["field"]: each["text"] for each in answer.json()["questions"]}
    assert words in asked[field]
    stored = http.get("/cameras/corner").json()
    assert stored["intrinsics"]["fx"] == {**CAMERA, **changes}["intrinsics"]["fx"]


@pytest.mark.parametrize(
    ("lens", "measured", "field", "words"),
    [
        ({"fx": 8, "fy": 8}, {}, "fx", "millimetres"),
        ({}, {"height_m": 784.0}, "height_m", "centimetres"),
        ({}, {"tilt_deg": -20.0}, "tilt_deg", "sign"),
    ],
)
def test_slips_are_asked_where_nobody_knows_the_pose(http, lens, measured, field, words):
    intrinsics = CAMERA["intrinsics"] | lens
    body = {"intrinsics": intrinsics} | ({"prior_pose": measured} if measured else {})
    asked = {
        each["field"]: each["text"] for each in http.post("/cameras", json=body).json()["questions"]
    }
    assert list(asked) == [field]
    assert words in asked[field]
    typed = {name: str(value) for name, value in intrinsics.items() if name != "distortion"}
    typed |= {f"measured_{name}": str(value) for name, value in measured.items()}
    (said,) = preview(http, form="people", **typed)["says"]
    assert said["field"] == (f"measured_{field}" if measured else field)
    assert words in said["text"]


def test_a_fisheye_by_millimetres_is_asked(http):
    camera = registered(http, {"fisheye": {"fx": 1.8}})
    assert [each["field"] for each in camera["questions"]] == ["fx"]
    assert registered(http, {"fisheye": {"fx": 600.0}})["questions"] == []


def test_a_good_camera_draws_no_question(http):
    assert http.post("/cameras", json=CAMERA).json()["questions"] == []


def test_the_form_takes_lenses_in_each_way(http):
    size = {"width": "1920", "height": "1080"}
    view = preview(http, lens_form="view", hfov_deg="90°", **size, **ANGLES)
    sensor = preview(
        http, lens_form="sensor", focal_mm="2,88", sensor_mm="5.76 x 3.24", **size, **ANGLES
    )
    assert sensor["errors"]["sensor_mm"].startswith("2 numbers are needed")
    sensor = preview(
        http, lens_form="sensor", focal_mm="2,88", sensor_mm="5.76 3.24", **size, **ANGLES
    )
    assert view["errors"] == sensor["errors"] == {}
    assert view["picture"] == sensor["picture"] != ""
    body = {"lens_form": "view", "hfov_deg": "90", **size, **ANGLES, "id": "by-form"}
    assert focal_px(http.post("/ui/register", json=body).json()) == pytest.approx(960.0)
    missing = http.post("/ui/register", json={**body, "hfov_deg": ""})
    assert problem(missing, 422, "malformed")["errors"][0]["pointer"] == "/hfov_deg"


def test_centimetres_in_the_form_are_mended_by_a_button(http):
    fields = {"width": "1920", "height": "1080", "fx": "1000", "tilt_deg": "20"}
    worst = preview(http, **fields, height_m="784")["says"][0]
    assert (worst["field"], worst["value"]) == ("height_m", "7.84")


FULL_HD = {**SIZE, "fx": 1500.0, "fy": 1500.0, "cx": 959.5, "cy": 539.5}
HALF = {"width": 960, "height": 540}


@pytest.mark.parametrize(
    ("changes", "pointer", "reason"),
    [
        ({"distortion": [-2.0, 0, 0, 0, 0]}, "distortion",
         "must not fold back within 540 px of the principal point (got a fold at 408 px; pixels "
         "beyond it have no viewing ray)"),
        ({**HALF, "cx": 960.0, "cy": 540.0}, "cx",
         "must be within the image, -0.5 to 959.5 px (got 960); the lens appears to be of an image "
         "of 1920 x 1080"),
        ({"fx": 0}, "fx", "must be at least 1 (got 0)"),
        ({"fx": "wide"}, "fx", "must be a number (got 'wide')"),
        ({"width": 1920.5}, "width", "must be a whole number (got 1920.5)"),
        ({"distortion": [0.1, 0.2, 0.3, 0.4]}, "distortion",
         "must have 5 numbers, k1, k2, p1, p2, k3 (got 4)"),
        ({"projection": "omni"}, "projection", "must be 'perspective' or 'fisheye' (got 'omni')"),
    ],
)  # fmt: skip
def test_impossible_lens_is_rejected_by_post_patch_and_form(http, changes, pointer, reason):
    lens = FULL_HD | changes
    expected = [{"pointer": f"/intrinsics/{pointer}", "reason": reason}]
    document = problem(http.post("/cameras", json={**CAMERA, "intrinsics": lens}), 422, "malformed")
    assert document["errors"] == expected
    http.post("/cameras", json=CAMERA).raise_for_status()
    changed = http.patch("/cameras/corner", json={"intrinsics": lens}, headers={"If-Match": "*"})
    assert problem(changed, 422, "malformed")["errors"] == expected
    if "got a" in reason or "within the image" in reason:
        shown = preview(http, **typed(lens), **ANGLES)
        assert shown["errors"] == {pointer: reason}


def typed(lens):
    """A lens as it is typed into the form."""
    rows = {**lens, "distortion": ", ".join(map(str, lens.get("distortion", [0])))}
    return {name: str(value) for name, value in rows.items()}


def test_impossible_lens_by_its_form_is_rejected(http):
    lens = {**SIZE, "fisheye": {"fx": 600.0, "distortion": [-2.0, 0, 0, 0]}}
    document = problem(http.post("/cameras", json={"id": "c", "lens": lens}), 422, "malformed")
    assert document["errors"][0]["pointer"] == "/lens/distortion"


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"cx": 0.0, "cy": 0.0}, "cx", "at a corner of the image. Is the camera matrix transposed"),
        ({"width": 1280, "height": 720}, "cx", "middle of an image of 1920 x 1080"),
        ({"width": 1080, "height": 1920}, "width", "if width and height were swapped"),
        ({"cx": 320.0, "cy": 240.0}, "cx", "(320, 240) is far from the middle"),
        ({"fy": 700.0}, "fy", "fx / fy is 2.14"),
        ({"distortion": [-0.28, 0.025, 0.163, 0.001, 0.0]}, "distortion", "p1 or p2 is 0.16"),
        ({"fx": 600.0, "fy": 600.0, "distortion": [-0.3, 0.1, 0, 0, -0.013]}, "distortion",
         "folds back 694 px from the principal point. The 38 % of the image"),
    ],
)  # fmt: skip
def test_unlikely_lens_is_questioned_by_post_patch_and_form(http, changes, field, words):
    lens = FULL_HD | changes
    made = http.post("/cameras", json={"id": "c", "intrinsics": lens, "prior_pose": POSE})
    assert made.status_code == 201
    (asked,) = made.json()["questions"]
    assert asked["field"] == field
    assert words in asked["text"]
    http.post("/cameras", json=CAMERA).raise_for_status()
    changed = http.patch("/cameras/corner", json={"intrinsics": lens}, headers={"If-Match": "*"})
    assert asked in changed.json()["questions"]
    shown = preview(http, **typed(lens), **ANGLES)
    assert [said["text"] for said in shown["says"] if said["kind"] == "warning"] == [asked["text"]]
