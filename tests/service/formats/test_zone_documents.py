"""Documents of zones: depth, numbers that are not pixels, zones too narrow to see."""

import json

import numpy as np
import pytest

from service.enums import ZoneOn
from service.errors import MalformedError, UnsupportedMediaTypeError
from service.formats.zone_formats import (
    JSON_TYPE,
    YAML_TYPE,
    ZoneFormat,
    format_of,
    read_document,
    read_zones,
    write_zones,
)
from surefoot.nesting import MAX_LEVELS, check_levels
from tests.conftest import SCENES

PICTURE = (1280, 720)
FIELD = SCENES.parent / "field"
SQUARE = [[0.25, 0.25], [0.75, 0.25], [0.75, 0.5]]
PIXELS = ((319.5, 179.5), (959.5, 179.5), (959.5, 359.5))


def read(value, kind=None):
    body = value if isinstance(value, bytes) else json.dumps(value).encode()
    document = read_document(kind, body, JSON_TYPE, "corner", str)
    return document, read_zones(kind, document, PICTURE, ZoneOn.GROUND)


def collection(ring, **top):
    shape = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    feature = {"type": "Feature", "id": "a", "properties": {}, "geometry": shape}
    return {"type": "FeatureCollection", **top, "features": [feature]}


def own(points, **top):
    return {**top, "zones": [{"id": "a", "points": points}]}


def axis(points, **top):
    triggers = [{"type": "includeArea", "vertices": points}]
    return {**top, "scenarios": [{"name": "a", "triggers": triggers}]}


def nested(levels):
    value = 1
    for _ in range(levels):
        value = [value]
    return value


@pytest.mark.parametrize(
    ("kind", "document"),
    [(None, own), (ZoneFormat.GEOJSON, collection), (ZoneFormat.AXIS, axis)],
)
@pytest.mark.parametrize("inner", ["list", "dict"])
def test_documents_have_at_most_32_levels(kind, document, inner):
    corners = [[100, 100], [300, 100], [300, 300]] if kind != ZoneFormat.AXIS else SQUARE
    extra = nested(MAX_LEVELS - 1)
    if inner == "dict":
        extra = json.loads(json.dumps(extra).replace("[", '{"a":').replace("]", "}"))
    deepest = document(corners, extra=extra)
    kept, zones = read(deepest, kind)
    if kind is not None:
        moved = {"a": PIXELS}
        assert json.loads(write_zones(kind, kept, PICTURE, zones, None)) == deepest
        assert json.loads(write_zones(kind, kept, PICTURE, zones, moved))["extra"] == extra
    for levels in (MAX_LEVELS, 600, 20_000):
        text = json.dumps(document(corners, extra=0)).replace(
            '"extra": 0', f'"extra": {"[" * levels}{"]" * levels}'
        )
        with pytest.raises(MalformedError, match="body: JSON is needed, .*(levels|deep)"):
            read(text.encode(), kind)


def test_levels_are_counted_without_recursion():
    check_levels(nested(MAX_LEVELS))
    check_levels("[" * 100)
    with pytest.raises(ValueError, match="at most 32 nested levels are accepted"):
        check_levels(nested(MAX_LEVELS + 1))
    value = nested(900)
    with pytest.raises(ValueError, match="at most 32"):
        check_levels({"a": value})


@pytest.mark.parametrize(("kind", "document"), [(None, own), (ZoneFormat.GEOJSON, collection)])
@pytest.mark.parametrize(
    "points",
    [SQUARE, [[0, 0], [1, 0], [1, 1], [0, 1]], [[-0.1, 0], [1.2, 0], [1.2, 1.1]],
     [[-1, 1], [1, 1], [1, -1]]],
)  # fmt: skip
def test_shares_of_the_image_are_not_pixels(kind, document, points):
    with pytest.raises(MalformedError, match='shares of the 1280 x 720 px image, send "norm'):
        read(document(points), kind)


@pytest.mark.parametrize(("kind", "document"), [(None, own), (ZoneFormat.GEOJSON, collection)])
def test_shares_and_other_sizes_are_scaled_and_written_back(kind, document):
    for top, points in (
        ({"normalised": True}, SQUARE),
        ({"size": [640, 360]}, [[159.5, 89.5], [479.5, 89.5], [479.5, 179.5]]),
    ):
        given = document(points, **top)
        kept, zones = read(given, kind)
        assert zones[0].corners == pytest.approx(np.array(PIXELS))
        if kind is not None:
            written = write_zones(kind, kept, PICTURE, zones, {"a": PIXELS})
            ring = json.loads(written)["features"][0]["geometry"]["coordinates"][0]
            assert np.array(ring[:-1]) == pytest.approx(np.array(points))
    for top, field in (({"normalised": 1}, "/normalised"), ({"size": [0, 3]}, "/size")):
        with pytest.raises(MalformedError) as found:
            read(document(SQUARE, **top), kind)
        assert found.value.errors[0].pointer == field


def test_small_normalised_zone_is_accepted_and_a_line_of_a_pixel_is_rejected():
    (zone,) = read(own([[0.5, 0.5], [0.503, 0.5], [0.503, 0.505]], normalised=True))[1]
    assert np.ptp(np.array(zone.corners), axis=0) == pytest.approx([3.84, 3.6])
    with pytest.raises(MalformedError, match=r"at least 1 px wide is needed, got 0\.64 px; remove"):
        read(own([[0.5, 0.5], [0.5005, 0.5]], normalised=True))


@pytest.mark.skipif(not FIELD.is_dir(), reason="no field files")
def test_longitude_and_latitude_of_the_field_file_are_rejected():
    body = (FIELD / "geojson_lon_lat.geojson").read_bytes()
    with pytest.raises(MalformedError, match="longitude and latitude, draw the zone in pixels"):
        read(body, ZoneFormat.GEOJSON)


@pytest.mark.parametrize("unit", ["metre", "m", 3])
def test_geojson_in_another_unit_is_rejected(unit):
    ring = [[100, 100], [300, 100], [300, 300]]
    read(collection(ring, unit="pixel"), ZoneFormat.GEOJSON)
    with pytest.raises(MalformedError, match="unit: pixel is needed"):
        read(collection(ring, unit=unit), ZoneFormat.GEOJSON)


@pytest.mark.parametrize(
    "points",
    [
        [[500, 300]] * 2000,
        [[500, 300], [500.5, 300]],
        [[100 + n, 200 + n / 3 + 0.4 * (n % 2)] for n in range(900)],
        [[500, 300], [900, 300], [900, 300.9]],
        [[500, 300], [900, 700], [500, 300]],
    ],
)
def test_zones_narrower_than_a_pixel_are_rejected(points):
    with pytest.raises(MalformedError, match="a zone at least 1 px wide is needed, got .* px"):
        read(own(points))


def test_named_format_and_media_type_must_agree():
    assert format_of(ZoneFormat.FRIGATE, JSON_TYPE) == ZoneFormat.FRIGATE
    assert format_of(None, YAML_TYPE) == ZoneFormat.FRIGATE
    with pytest.raises(UnsupportedMediaTypeError, match="format=geojson, got application/yaml"):
        format_of(ZoneFormat.GEOJSON, YAML_TYPE)
