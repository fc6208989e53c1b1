"""`/cameras/{id}/zones`: kept as drawn, told where they are, in every format and back."""

import copy
import json
import math
from datetime import UTC, datetime

import numpy as np
import pytest
import yaml
from fastapi.testclient import TestClient
from numpy.testing import assert_allclose
from sqlalchemy import delete

from models.geometry.ground import ground_from_pixel, pixel_from_ground
from service.app import create_app
from service.cameras.held_poses import held_pose
from service.store.cameras import forget_poses, prior_poses
from service.store.estimates import EstimateRecord
from service.store.references import SiteReferenceRecord
from service.store.trainings import ModelRecord, TrainingRecord
from tests.conftest import CAMERA
from tests.service.bench import PRIOR, moved
from tests.service.conftest import problem

URL = "/cameras/corner/zones"
TURNED = moved(tilt_deg=4)
GATE = {"id": "gate", "on": "ground", "points": [[400.25, 350], [800, 361], [900, 600]]}
WALL = {"id": "wall", "on": "scene", "points": [[100, 100], [300.125, 100], [300, 300]]}
LINE = {"id": "line", "on": "ground", "points": [[300, 500], [900, 520.5]]}
FRIGATE = """\
zones:
  gate:
    coordinates: 0.3126,0.4861,0.625,0.5014,0.70313,0.83333
    inertia: 3
    objects:
    - person
  Türe:
    coordinates:
    - 0.1,0.9
    - 0.2,0.9
    - 0.2,0.95
"""
AXIS = {
    "apiVersion": "1.4",
    "data": {
        "devices": [{"id": 1}],
        "scenarios": [
            {
                "name": "gate",
                "type": "motion",
                "triggers": [
                    {"type": "includeArea", "vertices": [[-0.4, 0.1], [0.4, 0.1], [0.3, -0.6]]}
                ],
                "filters": [
                    {"type": "timeShortLivedLimit", "time": 1},
                    {"type": "excludeArea", "vertices": [[-0.1, -0.2], [0, -0.2], [0, -0.3]]},
                ],
            },
            {
                "name": "crossing",
                "triggers": [{"type": "fence", "vertices": [[-0.123456789, -0.2], [0.4, -0.3]]}],
            },
        ],
    },
}
VMD = {"profiles": [{"name": "all", "triggers": [
    {"type": "includeArea", "data": [[-0.97, 0.1], [0.97, 0.1], [0.97, -0.97]]}]}]}  # fmt: skip
GEOJSON = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "id": "gate",
            "properties": {"on": "ground", "colour": "red"},
            "geometry": {"type": "Polygon", "coordinates": [[[400, 350], [800, 360.123456],
                                                             [900, 600], [400, 350]]]},
        },
        {
            "type": "Feature",
            "properties": {"name": "line"},
            "geometry": {"type": "LineString", "coordinates": [[300, 500], [900, 520]]},
        },
    ],
}  # fmt: skip
DOCUMENTS = {
    "frigate": ("application/yaml", FRIGATE),
    "axis": ("application/vnd.surefoot.axis-zones+json", json.dumps(AXIS)),
    "geojson": ("application/geo+json", json.dumps(GEOJSON)),
}


def put(http, body, etag="*", **query):
    """Our JSON, or a text of a media type."""
    kind, text = body if isinstance(body, tuple) else ("application/json", json.dumps(body))
    headers = {"Content-Type": kind, **({} if etag is None else {"If-Match": etag})}
    return http.put(URL, content=text.encode(), headers=headers, params=query)


def draw(http, *zones, **query):
    return put(http, {"zones": list(zones)}, **query).raise_for_status().json()


def value(text):
    return yaml.safe_load(text)


def test_first_put_needs_no_if_match_and_a_later_one_does(corner):
    first = put(corner, {"zones": [GATE]}, etag=None).raise_for_status()
    assert [zone["id"] for zone in first.json()["zones"]] == [GATE["id"]]
    later = put(corner, {"zones": []}, etag=None)
    assert problem(later, 428, "precondition_required")["etag"] == first.headers["etag"]
    assert corner.get(URL).json() == first.json()
    put(corner, {"zones": []}, etag=first.headers["etag"]).raise_for_status()
    problem(put(corner, {"zones": [GATE]}, etag=None), 428, "precondition_required")


def test_put_of_zones_requires_the_version_that_was_read(corner):
    first = corner.get(URL).raise_for_status()
    assert first.json()["zones"] == []
    problem(put(corner, {"zones": []}, etag='"other"'), 412, "precondition_failed")
    drawn = put(corner, {"zones": [GATE, WALL, LINE]}, etag=first.headers["etag"])
    assert drawn.raise_for_status().headers["etag"] != first.headers["etag"]
    stale = put(corner, {"zones": []}, etag=first.headers["etag"])
    problem(stale, 412, "precondition_failed")
    again = corner.get(URL)
    assert again.headers["etag"] == drawn.headers["etag"]
    assert again.json() == drawn.json()
    entries = corner.get("/activity", params={"camera_id": "corner"}).json()["items"]
    assert entries[-1]["what"] == "zones.drawn"


def test_where_nothing_moved_every_digit_is_as_it_came(corner):
    answer = draw(corner, GATE, WALL, LINE)
    assert answer["moved"] is False
    for zone, came in zip(answer["zones"], (GATE, WALL, LINE), strict=True):
        assert zone["points"] == zone["points_now"] == came["points"]
        assert (zone["on"], zone["overlap"]) == (came["on"], 1.0)
        assert zone["in_view"] == 1.0
        assert set(map(type, zone["sd_px"])) == {type(None)}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_document_comes_back_as_it_was(corner, name):
    media_type, text = DOCUMENTS[name]
    put(corner, DOCUMENTS[name], format=name).raise_for_status()
    back = corner.get(URL, params={"format": name}).raise_for_status()
    assert back.headers["content-type"].startswith(media_type)
    assert back.headers["content-disposition"].startswith('attachment; filename="corner-zones.')
    assert value(back.text) == value(text)


@pytest.mark.parametrize("name", DOCUMENTS)
@pytest.mark.parametrize("other", DOCUMENTS)
def test_other_formats_say_the_same_corners(corner, name, other):
    put(corner, DOCUMENTS[name], format=name).raise_for_status()
    before = corner.get(URL).json()["zones"]
    text = corner.get(URL, params={"format": other}).text
    put(corner, (DOCUMENTS[other][0], text), format=other).raise_for_status()
    after = corner.get(URL).json()["zones"]
    if other == "frigate":  # which has no lines
        before = [zone for zone in before if len(zone["points"]) > 2]
    assert [zone["id"] for zone in after] == [zone["id"] for zone in before]
    for zone, was in zip(after, before, strict=True):
        assert_allclose(zone["points"], was["points"], atol=0.02)


def test_pixels_are_shares_of_the_picture_from_its_edge(corner):
    put(corner, ("application/yaml", "zones: {a: {coordinates: '0,0,1,0,1,1'}}")).raise_for_status()
    (zone,) = corner.get(URL).json()["zones"]
    assert zone["points"] == [[-0.5, -0.5], [1279.5, -0.5], [1279.5, 719.5]]
    axis = {"scenarios": [{"name": "a", "triggers": [{"vertices": [[-1, 1], [1, 1], [1, -1]]}]}]}
    put(corner, axis, format="axis").raise_for_status()
    assert corner.get(URL).json()["zones"][0]["points"] == zone["points"]


def test_ground_goes_by_the_ground_and_the_scene_by_the_rotation(bench):
    draw(bench.http, GATE, WALL)
    bench.see(moved(tilt_deg=4, roll_deg=-3), change=5, paths=True)
    answer = bench.http.get(URL).json()
    assert answer["moved"] is True
    gate, wall = answer["zones"]
    now = answer["by"]["pose"]
    rotation, centre = np.array(now["rotation"]), np.array([0, 0, now["height_m"]])
    lens = np.array([[1100, 0, 639.5], [0, 1100, 359.5], [0, 0, 1.0]])
    uv = np.column_stack([np.array(GATE["points"]), np.ones(3)])
    rays = np.linalg.solve(lens, uv.T).T @ PRIOR.rotation
    ground = PRIOR.height_m * rays / -rays[:, 2:] + [0, 0, PRIOR.height_m]
    seen = (ground - centre) @ rotation.T @ lens.T
    assert_allclose(gate["points_now"], seen[:, :2] / seen[:, 2:], atol=1e-3)
    turn = lens @ rotation @ PRIOR.rotation.T @ np.linalg.inv(lens)
    far = np.column_stack([np.array(WALL["points"]), np.ones(3)]) @ turn.T
    assert_allclose(wall["points_now"], far[:, :2] / far[:, 2:], atol=1e-3)
    assert answer["shift_m"] == pytest.approx(abs(now["height_m"] - 6.0))
    for major, minor, angle in [*gate["sd_px"], *wall["sd_px"]]:
        assert 30 > major >= minor >= 0
        assert 0 <= angle < 180
    assert 0 < gate["overlap"] < 1
    assert gate["points"] == GATE["points"]


def test_corners_of_a_moved_camera_include_a_heading_that_is_not_determined(bench):
    """Its standard deviation, 6.3 deg by what is stored, is so many pixels across the image."""
    draw(bench.http, GATE, WALL)
    bench.see(moved(tilt_deg=4), change=5)
    gate, wall = bench.http.get(URL).json()["zones"]
    with bench.store.read() as session:
        sd_rad = math.sqrt(held_pose(session, "corner").own[3, 3])
    assert sd_rad > math.radians(3)
    (u, v) = wall["points_now"][2]
    ray = np.array([(u - 639.5) / 1100, (v - 359.5) / 1100, 1.0])
    down = np.array([0, np.cos(math.radians(26)), np.sin(math.radians(26))])  # about: tilt 22 + 4
    turned = np.cross(down, ray)
    across_px = 1100 * sd_rad * np.hypot(*(turned[:2] - ray[:2] * turned[2]))
    assert wall["sd_px"][2][0] == pytest.approx(across_px, rel=0.05)
    assert min(major for major, _, _ in gate["sd_px"]) > 50


def test_corners_have_an_error_if_the_tracks_determine_nothing(bench):
    draw(bench.http, GATE)
    bench.see(moved(tilt_deg=4), unidentifiable=("tilt", "roll", "height"))
    answer = bench.http.get(URL).json()
    assert (answer["by"]["drifted"], answer["by"]["estimated"]) == (False, [])
    assert answer["zones"][0]["points_now"] == GATE["points"]
    with bench.store.read() as session:
        sd_rad = np.sqrt(np.diag(held_pose(session, "corner").own))
    tilt_px = 1100 * sd_rad[0]  # of a corner near the middle, at least
    assert tilt_px > 5
    assert all(major > tilt_px for major, _, _ in answer["zones"][0]["sd_px"])


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_mended_document_has_other_corners_and_the_rest_as_it_was(bench, name):
    put(bench.http, DOCUMENTS[name], format=name).raise_for_status()
    bench.see(TURNED, change=5)
    now = {zone["id"]: zone["points_now"] for zone in bench.http.get(URL).json()["zones"]}
    mended = value(bench.http.get(URL, params={"format": name}).text)
    came = value(DOCUMENTS[name][1])
    assert mended != came
    at = {
        "frigate": lambda d: d["zones"]["gate"],
        "axis": lambda d: d["data"]["scenarios"][0]["triggers"][0],
        "geojson": lambda d: d["features"][0]["geometry"],
    }[name]
    corners = {
        "frigate": lambda c: (
            np.reshape([float(x) for x in c["coordinates"].split(",")], (-1, 2)) * (1280, 720) - 0.5
        ),
        "axis": lambda c: (np.array(c["vertices"]) * (1, -1) + 1) / 2 * (1280, 720) - 0.5,
        "geojson": lambda c: np.array(c["coordinates"][0][:-1]),
    }[name](at(mended))
    assert_allclose(corners, now["gate"], atol=0.02)
    for document in (mended, came):
        at(document).clear()
    others = {"frigate": ("Türe",), "axis": ("gate 2", "crossing"), "geojson": ("line",)}[name]
    assert set(now) == {"gate", *others}
    if name == "frigate":
        assert isinstance(mended["zones"].pop("Türe")["coordinates"], list)
        came["zones"].pop("Türe")
    if name == "axis":
        assert mended["data"]["devices"] == came["data"]["devices"]
        assert mended["data"]["scenarios"][0]["filters"][0] == {
            "type": "timeShortLivedLimit",
            "time": 1,
        }
    if name == "geojson":
        assert mended["features"][0]["properties"] == {"on": "ground", "colour": "red"}


def test_what_has_left_the_picture_is_cut_and_left_out_where_it_has_to_be(bench):
    edge = {"id": "edge", "points": [[10, 600], [200, 600], [200, 700], [10, 700]]}
    draw(bench.http, edge, GATE)
    bench.see(moved(heading_deg=12), change=5, paths=True)
    answer = bench.http.get(URL).json()
    left, gate = answer["zones"]
    assert left["in_view"] == 0.0
    assert max(u for u, _ in left["points_now"]) < 0
    assert len(left["points_now"]) == len(left["sd_px"])
    text = bench.http.get(URL, params={"format": "frigate"}).text
    assert set(value(text)["zones"]) == {"gate"}
    shares = [float(x) for x in value(text)["zones"]["gate"]["coordinates"].split(",")]
    assert all(0 <= x <= 1 for x in shares)


def test_zones_that_are_drawn_late_are_of_the_pose_that_held_then(bench):
    before = bench.clock_s
    bench.see(TURNED, change=5)
    late = draw(bench.http, GATE)["zones"][0]
    assert late["points_now"] == GATE["points"]
    at = datetime.fromtimestamp(before, UTC).isoformat()
    earlier = draw(bench.http, GATE, drawn_at=at)
    assert earlier["moved"] is True
    assert earlier["zones"][0]["points_now"] != GATE["points"]


def test_an_accepted_pose_keeps_zones_where_the_drift_had_them(bench):
    draw(bench.http, GATE)
    bench.see(TURNED, change=5)
    before = bench.http.get(URL).json()["zones"]
    bench.http.post("/cameras/corner/pose/accept").raise_for_status()
    assert bench.http.get(URL).json()["zones"] == before


def test_zones_of_a_drift_stay_where_they_were_drawn_once_its_pose_is_accepted(bench):
    bench.see(TURNED, change=5)
    draw(bench.http, GATE)
    bench.see(moved(tilt_deg=4.2))
    assert bench.http.get(URL).json()["moved"] is True
    bench.http.post("/cameras/corner/pose/accept").raise_for_status()
    answer = bench.http.get(URL).json()
    assert (answer["moved"], answer["zones"][0]["points_now"]) == (False, GATE["points"])


def test_another_lens_moves_them_too(corner):
    draw(corner, GATE)
    etag = corner.get("/cameras/corner").headers["etag"]
    wider = {**CAMERA["intrinsics"], "fx": 550, "fy": 550}
    change = corner.patch("/cameras/corner", json={"intrinsics": wider}, headers={"If-Match": etag})
    change.raise_for_status()
    (zone,) = corner.get(URL).json()["zones"]
    middle = np.array([639.5, 359.5])
    expected = (np.array(GATE["points"]) - middle) / 2 + middle
    assert_allclose(zone["points_now"], expected, atol=1e-3)


@pytest.mark.parametrize(
    ("body", "query", "said"),
    [
        ({"zones": [{**GATE, "points": [[1, 2]]}]}, {}, "/zones/0"),
        ({"zones": [GATE, GATE]}, {}, "/zones/1"),
        ({"zones": [{**GATE, "on": "sky"}]}, {}, "/zones/0"),
        ({"zones": [{**GATE, "id": ""}]}, {}, "/zones/0"),
        ({"zones": [{**GATE, "points": [[1, 2], [1e9, 4]]}]}, {}, "/zones/0"),
        ({"zones": [{**GATE, "points": [[1, 2], [True, 4]]}]}, {}, "/zones/0"),
        ({"zones": [{**GATE, "points": [[1, 2], [None, 4]]}]}, {}, "/zones/0"),
        ({"zones": [{"id": str(n), "points": [[1, 1], [2, 2]]} for n in range(101)]}, {},
         "/zones/100"),
        ({"zones": [{**GATE, "points": [[n / 10, n / 10] for n in range(2001)]}]}, {}, "/zones/0"),
        ({"zones": 3}, {}, "/zones"),
        ([], {}, "/zones"),
        (("application/yaml", "zones: {a: {coordinates: '0,0,2,0,1,1'}}"), {},
         "/zones/a/coordinates"),
        (("application/yaml", "zones: {a: {}}"), {}, "/zones/a/coordinates"),
        (("application/yaml", "cameras: {a: {}, b: {}}"), {}, "/cameras"),
        (("application/yaml", "cameras: {a: 3}"), {}, "/cameras/a"),
        ({"scenarios": [3]}, {"format": "axis"}, "/scenarios/0"),
        ({"scenarios": {}}, {"format": "axis"}, ""),
        ({"features": [{"geometry": {"type": "Point"}}]}, {"format": "geojson"},
         "/features/0/geometry"),
    ],
)  # fmt: skip
def test_what_is_refused_is_named(corner, body, query, said):
    told = problem(put(corner, body, **query), 422, "malformed")
    assert told["errors"][0]["pointer"] == said


@pytest.mark.parametrize(
    "text",
    [
        "a: &a [x]\nb: *a",
        "zones: [",
        "? [1, 2]\n: 3",
        "d: 2026-11-25",
        "x: .nan",
        "[" * 64 * 1024,  # half an hour, where nobody counts them
        "!!python/object/apply:os.system [true]",
    ],
)
def test_yaml_that_is_none_or_too_much_is_refused(corner, text):
    problem(put(corner, ("application/yaml", text)), 422, "malformed")


@pytest.mark.parametrize("text", ['{"zones": [], "a": "\\ud800"}', '{"zones": [], "a": NaN}'])
def test_json_that_cannot_be_said_again_is_refused(corner, text):
    problem(put(corner, ("application/json", text)), 422, "malformed")
    huge = f'{{"zones": [{{"id": "a", "points": [[1, 2], [3, 1{"0" * 400}]]}}]}}'
    problem(put(corner, ("application/json", huge)), 422, "malformed")


def test_other_types_and_too_much_are_refused(corner):
    problem(put(corner, ("text/plain", "x")), 415, "unsupported_media_type")
    problem(put(corner, ("application/yaml", "#" * 70_000)), 413, "too_large")
    problem(put(corner, ("application/json", "[" * 100_000)), 422, "malformed")
    problem(corner.get("/cameras/none/zones"), 404, "not_found")


def test_put_zones_nested_too_deep_changes_nothing(corner):
    put(corner, DOCUMENTS["geojson"], format="geojson").raise_for_status()
    before = corner.get(URL, params={"format": "geojson"})
    for levels in (33, 600, 900, 2_000, 100_000):
        text = f'{DOCUMENTS["geojson"][1][:-1]}, "extra": {"[" * levels}{"]" * levels}}}'
        problem(put(corner, ("application/geo+json", text)), 422, "malformed")
    after = corner.get(URL, params={"format": "geojson"}).raise_for_status()
    assert (after.text, after.headers["etag"]) == (before.text, before.headers["etag"])


@pytest.mark.parametrize("scalar", ['!!int ""', '!!bool "x"', '!!float ""', "!!timestamp x", "007"])
def test_put_frigate_yaml_never_converts_scalars(corner, scalar):
    text = f"{FRIGATE}mqtt:\n    # broker\n    password: {scalar}\n"
    put(corner, ("application/yaml", text)).raise_for_status()
    assert corner.get(URL, params={"format": "frigate"}).text == text


def test_put_frigate_configuration_finds_the_camera_by_the_setting(http, settings):
    named = settings.model_copy(update={"mqtt_cameras": "Cam 7=corner"})
    zone = "{zones: {a: {coordinates: '0.1,0.9,0.2,0.9,0.2,0.95'}}}"
    text = f"cameras: {{other: {zone}, Cam 7: {zone.replace('a:', 'b:')}}}\n"
    with TestClient(create_app(named)) as client:
        client.post("/cameras", json=CAMERA).raise_for_status()
        put(client, ("application/yaml", text)).raise_for_status()
        assert [zone["id"] for zone in client.get(URL).json()["zones"]] == ["b"]
        assert client.get(URL, params={"format": "frigate"}).text == text
    http.post("/cameras", json={**CAMERA, "id": "c"})
    body = put(http, ("application/yaml", text))
    assert "MQTT_CAMERAS maps names" in problem(body, 422, "malformed")["detail"]


def test_put_zones_in_shares_names_the_fix(corner):
    shares = {"zones": [{"id": "a", "points": [[0.1, 0.9], [0.2, 0.9], [0.2, 0.95]]}]}
    detail = problem(put(corner, shares), 422, "malformed")["detail"]
    assert detail == (
        "zones/0: a zone at least 1 px wide is needed, got 0.0479 px; "
        'if these are shares of the 1280 x 720 px image, send "normalised": true'
    )
    (zone,) = put(corner, {**shares, "normalised": True}).raise_for_status().json()["zones"]
    assert_allclose(zone["points"], [[127.5, 647.5], [255.5, 647.5], [255.5, 683.5]])
    assert zone["in_view"] == 1.0


def test_the_prior_pose_that_they_were_drawn_at_is_kept(bench):
    draw(bench.http, GATE)
    for tilt_deg in (4, 8):
        bench.see(moved(tilt_deg=tilt_deg), change=5)
        bench.http.post("/cameras/corner/pose/accept").raise_for_status()
        bench.learn()
    with bench.store.write() as session:
        first, second, third = [each.id for each in prior_poses(session, "corner", 9)][::-1]
        for table in (EstimateRecord, SiteReferenceRecord, ModelRecord, TrainingRecord):
            session.execute(delete(table))
        assert forget_poses(session, "corner", 1, 100) == 1
        assert [each.id for each in prior_poses(session, "corner", 9)] == [third, first]


def test_they_go_with_their_camera(corner):
    draw(corner, GATE)
    etag = corner.get("/cameras/corner").headers["etag"]
    corner.delete("/cameras/corner", headers={"If-Match": etag}).raise_for_status()
    corner.post("/cameras", json=copy.deepcopy(CAMERA)).raise_for_status()
    assert corner.get(URL).json()["zones"] == []


def test_ground_from_pixel_is_what_the_page_draws_by():
    """The same two functions place feet on pages, in drawings and here."""
    from service.pages.drawings import ground_plan, picture

    assert ground_plan.ground_from_pixel is ground_from_pixel
    assert picture.pixel_from_ground is pixel_from_ground


def test_they_stay_as_drawn_at_the_first_prior_pose_that_is_said(http):
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    http.post("/cameras", json=bare).raise_for_status()
    draw(http, GATE)
    said = {"prior_pose": {"height_m": 9.0, "tilt_deg": 35.0}}
    http.patch("/cameras/corner", json=said, headers={"If-Match": "*"}).raise_for_status()
    answer = http.get(URL).json()
    assert (answer["moved"], answer["zones"][0]["points_now"]) == (False, GATE["points"])
