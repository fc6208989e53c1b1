"""Frigate's configuration: zones edited in place, and everything else left as it came."""

import pytest
import yaml

from service.enums import ZoneOn
from service.errors import MalformedError
from service.formats.zone_formats import (
    YAML_TYPE,
    ZoneFormat,
    read_document,
    read_zones,
    write_zones,
)
from surefoot.bridge.camera_names import camera_id_of
from tests.conftest import SCENES

FIELD = SCENES.parent / "field"
needs_field = pytest.mark.skipif(not FIELD.is_dir(), reason="no field files")
PICTURE = (1280, 720)
NAMES = {"cam7": "gate"}

CONFIG = """\
# Camera server, ground floor
mqtt:
    host: broker   # four blanks
    password: 0123456
    pin: 007
    at: 1:30
    none: ~
    text: 'it''s'
    empty: !!int ""
    key: !ENV "{FRIGATE_KEY}"
? [1, 2]
: 3
defaults: &objects [ person,
                     car ]
cameras:
  front_door:
    zones:
      # first
      porch: {coordinates: "0.1,0.9,0.5,0.9,0.5,0.5", inertia: 3}   # kept

      steps:   # second
        coordinates:
        - 0.1,0.9   # left
        - '0.2,0.9'
        - 0.2,0.95
        objects: *objects
      # third
      lawn:
        coordinates: >
          0.2,0.9,0.5,0.9,
          0.5,0.5
      Türe 😀:
        objects: *objects
        coordinates: [0.1, 0.8, 0.2, 0.8, 0.2, 0.9]
    # end of the zones
    detect: {width: 1280, height: 720}
  back_yard:\t
    zones: {}
version: 0.16-0
"""  # fmt: skip


def read(text, camera_id="front-door", media_type=YAML_TYPE):
    """The kept document and its zones."""
    body = text if isinstance(text, bytes) else text.encode()
    document = read_document(
        ZoneFormat.FRIGATE, body, media_type, camera_id, lambda name: camera_id_of(name, NAMES)
    )
    return document, read_zones(ZoneFormat.FRIGATE, document, PICTURE, ZoneOn.GROUND)


def written(document, zones, moved):
    return write_zones(ZoneFormat.FRIGATE, document, PICTURE, zones, moved)


def shares(*pairs):
    return [(x * 1280 - 0.5, y * 720 - 0.5) for x, y in pairs]


SQUARE = shares((0.25, 0.25), (0.75, 0.25), (0.75, 0.5))


def changed_lines(before, after):
    """Pairs of lines that differ, of two texts of as many lines."""
    lines = zip(before.splitlines(), after.splitlines(), strict=True)
    return [(was, now) for was, now in lines if was != now]


@pytest.mark.parametrize("text", [CONFIG, CONFIG.replace("\n", "\r\n"), "\ufeff" + CONFIG])
def test_configuration_of_an_unmoved_camera_comes_back_as_it_was(text):
    document, zones = read(text)
    assert written(document, zones, None) == text.removeprefix("\ufeff")
    assert [zone.id for zone in zones] == ["porch", "steps", "lawn", "Türe 😀"]


def test_moved_zones_change_their_coordinates_and_nothing_else():
    document, zones = read(CONFIG)
    moved = {zone.id: zone.corners for zone in zones} | {"porch": SQUARE, "steps": SQUARE}
    text = written(document, zones, moved)
    assert changed_lines(CONFIG.split("      # third")[0], text.split("      # third")[0]) == [
        (
            '      porch: {coordinates: "0.1,0.9,0.5,0.9,0.5,0.5", inertia: 3}   # kept',
            '      porch: {coordinates: "0.25,0.25,0.75,0.25,0.75,0.5", inertia: 3}   # kept',
        ),
        ("        - 0.1,0.9   # left", "        - 0.25,0.25   # left"),
        ("        - '0.2,0.9'", "        - '0.75,0.25'"),
        ("        - 0.2,0.95", "        - 0.75,0.5"),
    ]  # fmt: skip
    again = read(text)[1]
    assert {zone.id: zone.corners for zone in again}["lawn"] == zones[2].corners


def test_other_number_of_corners_is_written_in_the_form_that_came():
    document, zones = read(CONFIG)
    four = [*SQUARE, *shares((0.25, 0.5))]
    text = written(document, zones, {zone.id: four for zone in zones})
    again = {zone.id: zone.corners for zone in read(text)[1]}
    assert again == {zone.id: tuple(four) for zone in zones}
    assert "      lawn:\n        coordinates: 0.25,0.25,0.75,0.25,0.75,0.5,0.25,0.5\n" in text
    assert 'coordinates: ["0.25", "0.25", "0.75", "0.25", "0.75", "0.5", "0.25", "0.5"]\n' in text
    assert (
        "        - 0.25,0.25\n        - 0.75,0.25\n        - 0.75,0.5\n        - 0.25,0.5\n" in text
    )


@pytest.mark.parametrize("gone", [1, 2, 4, 3, 6, 9, 5, 7, 14, 15])
def test_zones_outside_the_image_are_removed_and_the_rest_stays(gone):
    document, zones = read(CONFIG)
    left = {zone.id: zone.corners for n, zone in enumerate(zones) if not gone >> n & 1}
    text = written(document, zones, left)
    if not left:
        assert "    zones:\n      # first\n      {}\n    # end of the zones\n    detect:" in text
    else:
        assert [zone.id for zone in read(text)[1]] == list(left)
    head, tail = CONFIG.split("      # first")[0], CONFIG.split("    # end of the zones")[1]
    assert text.startswith(head)
    assert text.endswith(tail)
    for comment, owner in (("# left", "steps"), ("# kept", "porch")):
        assert (comment in text) == (owner in left)


@pytest.mark.parametrize("gone", range(1, 8))
@pytest.mark.parametrize("end", ["", ","])
def test_zones_are_removed_from_braces(gone, end):
    zone = '{{coordinates: "0.1,0.9,0.5,0.9,0.5,0.5", n: {0}}}'
    inner = ", ".join(f"z{n}: {zone.format(n)}" for n in range(3))
    document, zones = read(f"zones: {{ {inner}{end} }}  # end\n")
    left = {each.id: SQUARE for n, each in enumerate(zones) if not gone >> n & 1}
    text = written(document, zones, left)
    assert text.endswith("}  # end\n") or text == "zones: {}  # end\n"
    assert yaml.safe_load(text) == {
        "zones": {
            name: {"coordinates": "0.25,0.25,0.75,0.25,0.75,0.5", "n": int(name[1:])}
            for name in left
        }
    }


@needs_field
@pytest.mark.parametrize(
    ("camera_id", "zone"), [("front-door", "porch"), ("back-yard", "lawn")]
)  # fmt: skip
def test_camera_with_an_underscore_is_found_by_its_id(camera_id, zone):
    text = (FIELD / "frigate_two_cameras_underscore.yml").read_text()
    document, zones = read(text, camera_id)
    assert [each.id for each in zones] == [zone]
    moved = written(document, zones, {zone: SQUARE})
    (line,) = changed_lines(text, moved)
    assert line[1].strip() == "coordinates: 0.25,0.25,0.75,0.25,0.75,0.5"


def test_camera_is_found_by_a_name_of_the_setting():
    zone = "{zones: {a: {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}}}"
    assert read(f"cameras: {{cam7: {zone}, gate_2: {{}}}}", "gate")[0]["camera"] == "cam7"
    with pytest.raises(MalformedError, match="one camera that maps to gate is needed.*got 2: a, b"):
        read(f"cameras: {{a: {zone}, b: {zone}}}", "gate")
    with pytest.raises(MalformedError, match="got 2: Gate, GATE"):
        read(f"cameras: {{Gate: {zone}, GATE: {zone}}}", "gate")


@pytest.mark.parametrize("detect", ["camera", "top", "merge"])
def test_zones_in_pixels_of_the_detect_stream(detect):
    size = {
        "camera": "    detect: {width: 640, height: 360}\n",
        "top": "",
        "merge": "    detect: {<<: *size, fps: 5}\n",
    }[detect]
    text = (
        "detect: &size {width: 640, height: 360}\n"
        f"cameras:\n  door:\n{size}    zones:\n      porch:\n"
        "        coordinates: 320,350,450,350,450,200,0,200\n"
    )  # fmt: skip
    document, zones = read(text, "door")
    assert zones[0].corners == tuple(
        shares((0.5, 350 / 360), (450 / 640, 350 / 360), (450 / 640, 200 / 360), (0, 200 / 360))
    )
    assert "coordinates: 160,90,480,90,480,180\n" in written(document, zones, {"porch": SQUARE})


@needs_field
def test_field_file_in_pixels_has_the_corners_of_its_detect_size():
    zones = read((FIELD / "frigate_zones_in_pixels.yml").read_text())[1]
    assert zones[0].corners == ((639.5, 699.5), (899.5, 699.5), (899.5, 399.5), (-0.5, 399.5))


def test_pixels_without_detect_are_rejected_with_the_fix():
    with pytest.raises(MalformedError, match=r"pixels, which need detect: \{width, height\}"):
        read("zones: {a: {coordinates: '640,700,900,700,900,400'}}")
    beyond = "{detect: {width: 640, height: 360}, zones: {a: {coordinates: '641,2,3,4,5,6'}}}"
    with pytest.raises(MalformedError, match="pixels within the 640 x 360 of detect are needed"):
        read(beyond)


@pytest.mark.parametrize(
    "text",
    [
        "a: &a {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}\nzones: {b: *a}",
        "a: &a {b: {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}}\nzones: *a",
        "a: &a '0.1,0.9,0.5,0.9,0.5,0.5'\nzones: {b: {coordinates: *a}}",
        "a: &a {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}\nzones: {b: {<<: *a}}",
        "zones: {b: {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5', objects: &o [person]}}\nc: *o",
        "zones: &z {b: {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}}\nc: *z",
        "zones: &z {b: *z}",
        "cameras: &c {gate: *c}",
    ],
)
def test_zones_that_share_their_text_are_rejected(text):
    with pytest.raises(MalformedError, match=r"would change other parts too|zones are needed"):
        read(text)


@pytest.mark.parametrize(
    "text",
    [
        "zones: {a: {coordinates: 'nan,0.9,0.5,0.9,0.5,0.5'}}",
        "zones: {a: {coordinates: 'inf,0.9,0.5,0.9,0.5,0.5'}}",
        "zones: {a: {coordinates: '-0.1,0.9,0.5,0.9,0.5,0.5'}}",
        "zones: {a: {coordinates: ''}}",
        "zones: {a: {coordinates: {x: 1}}}",
        "zones: {a: {coordinates: [[0.1, 0.2]]}}",
        "zones: {a: {coordinates: '0.1,0.9,0.5'}}",
        "zones: {a: 3}",
        "zones: {? [a] : {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}}",
        "zones: {a: {coordinates: '0.1,0.9,0.5,0.9,0.5,0.5'}}\nzones: {}",
        "zones: {a: {coordinates: '0.5,0.5,0.5,0.5,0.5,0.5'}}",
        "zones: {a: {coordinates: '0.1,0.1,0.5,0.5,0.9,0.9'}}",
        "--- 1\n--- 2\n",
        "",
        "a",
        "zones: *unknown",
    ],
)
def test_what_has_no_usable_zones_is_rejected(text):
    with pytest.raises(MalformedError):
        read(text)


@pytest.mark.parametrize(
    "scalar",
    ['!!int ""', '!!bool "x"', '!!float ""', "!!timestamp x", '!!int "-"', '!!binary "é"', 
     "!!null x", "2001-13-45", "!!python/name:os.system x", "=", ".nan", "0b", "!secret x"],
)  # fmt: skip
def test_scalars_are_never_converted(scalar):
    text = f"zones: {{a: {{coordinates: '0.1,0.9,0.5,0.9,0.5,0.5', n: {scalar}}}}}\n"
    document, zones = read(text)
    moved = written(document, zones, {"a": SQUARE})
    assert moved == text.replace("0.1,0.9,0.5,0.9,0.5,0.5", "0.25,0.25,0.75,0.25,0.75,0.5")


def test_zones_from_another_format_are_written_as_frigate_has_them():
    _, zones = read(CONFIG)
    text = written(None, zones, None)
    assert yaml.safe_load(text)["zones"]["porch"] == {"coordinates": "0.1,0.9,0.5,0.9,0.5,0.5"}
    assert [zone.id for zone in read(text)[1]] == [zone.id for zone in zones]


def test_json_with_tabs_is_accepted_as_a_frigate_configuration():
    body = b'{"zones":\t{"a":\t{"coordinates": "0.1,0.9,0.5,0.9,0.5,0.5"}}}'
    assert [zone.id for zone in read(body, media_type="application/json")[1]] == ["a"]
