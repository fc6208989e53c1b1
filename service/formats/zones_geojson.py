"""Zones as GeoJSON (RFC 7946) in pixels: a feature each, a polygon or a line of two points."""

from collections.abc import Iterator, Sequence
from typing import Any

from service.formats.zones import Corner, Slot, Zone, refused

_DIGITS = 3
_AREA, _LINE, _UNIT = "Polygon", "LineString", "pixel"


def geojson_slots(document: Any) -> Iterator[Slot]:
    """The features of a collection; a ring ends where it began."""
    features = document.get("features") if isinstance(document, dict) else None
    if not isinstance(features, list):
        raise refused("/features", "GeoJSON's features are needed, a list")
    if document.get("unit", _UNIT) != _UNIT:  # metres of the ground, which the pose comes in
        raise refused("/unit", f"{_UNIT} is needed, got {document['unit']!r:.40}")
    for number, feature in enumerate(list(features)):
        pointer = f"/features/{number}"
        shape = feature.get("geometry") if isinstance(feature, dict) else None
        if not isinstance(shape, dict) or shape.get("type") not in (_AREA, _LINE):
            raise refused(f"{pointer}/geometry", f"a {_AREA} or {_LINE} is needed")
        properties = feature.get("properties") or {}
        said = properties if isinstance(properties, dict) else {}
        yield Slot(
            id=next((x for x in (feature.get("id"), said.get("id"), said.get("name")) if x), None),
            pointer=f"{pointer}/geometry/coordinates",
            corners=_corners(shape, f"{pointer}/geometry/coordinates"),
            put=_put(shape),
            drop=_drop(features, feature),
            on=said.get("on"),
        )


def geojson_template(zones: Sequence[Zone]) -> Any:
    """A collection of zones, whose coordinates are to be put in."""
    features = [
        {
            "type": "Feature",
            "id": zone.id,
            "properties": {"on": zone.on},
            "geometry": {"type": _LINE, "coordinates": [[0, 0], [0, 0]]}
            if len(zone.corners) == 2
            else {"type": _AREA, "coordinates": [[[0, 0], [0, 1], [1, 1], [0, 0]]]},
        }
        for zone in zones
    ]
    return {"type": "FeatureCollection", "crs": None, "unit": _UNIT, "features": features}


def _corners(shape: Any, pointer: str) -> Any:
    given = shape.get("coordinates")
    if shape["type"] == _LINE:
        if isinstance(given, list) and len(given) != 2:
            raise refused(pointer, f"a line of two points is needed, got {len(given)}")
        return given
    if not isinstance(given, list) or len(given) != 1 or not isinstance(given[0], list):
        raise refused(pointer, "a polygon of one ring, without holes, is needed")
    ring = given[0]
    if len(ring) < 4 or ring[0] != ring[-1]:
        raise refused(pointer, "a ring of 4 points or more that ends where it began is needed")
    return ring[:-1]


def _put(shape: Any) -> Any:
    def put(corners: Sequence[Corner]) -> None:
        rows = [[round(u, _DIGITS), round(v, _DIGITS)] for u, v in corners]
        shape["coordinates"] = rows if shape["type"] == _LINE else [[*rows, rows[0]]]

    return put


def _drop(features: list[Any], feature: Any) -> Any:
    return lambda: features.pop(next(n for n, each in enumerate(features) if each is feature))
