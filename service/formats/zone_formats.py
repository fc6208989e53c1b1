"""Zones in the documents of other systems: read, and written back with other corners."""

import copy
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from models.tracks.scaling import Scaling
from service.enums import ZoneOn
from service.errors import MalformedError, TooLargeError, UnsupportedMediaTypeError
from service.formats.scaling import read_scaling
from service.formats.yaml_text import MAX_BYTES, read_yaml_text
from service.formats.zones import Corner, Slot, Zone, refused, scaled, scaling_of, zones_of
from service.formats.zones_axis import axis_slots, axis_template
from service.formats.zones_frigate import (
    FrigateText,
    frigate_document,
    frigate_slots,
    frigate_template,
)
from service.formats.zones_geojson import geojson_slots, geojson_template
from surefoot.nesting import check_levels

JSON_TYPE, YAML_TYPE = "application/json", "application/yaml"
GEOJSON_TYPE, AXIS_TYPE = "application/geo+json", "application/vnd.surefoot.axis-zones+json"


class ZoneFormat(StrEnum):
    """The formats of zones beside our own JSON."""

    FRIGATE = "frigate"
    GEOJSON = "geojson"
    AXIS = "axis"


def _shares(document: Any, picture: tuple[int, int]) -> Scaling | None:
    return read_scaling(None, True, picture)


def _axis_scaling(document: Any, picture: tuple[int, int]) -> Scaling | None:
    width, height = picture
    return Scaling(factor=(width / 2, -height / 2), shift=((width - 1) / 2, (height - 1) / 2))


def _json_text(document: Any) -> str:
    return json.dumps(document, ensure_ascii=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """A format: how a kept document is opened, its zones are found, and it becomes text again.

    `scaling` is from the numbers of a document to pixels of an image of a size; `cut` is true if a
    document must not have corners outside the image.
    """

    media_type: str
    ending: str
    open: Callable[[Any], Any]
    slots: Callable[[Any], Iterator[Slot]]
    text: Callable[[Any], str]
    template: Callable[[Sequence[Zone]], Any]
    scaling: Callable[[Any, tuple[int, int]], Scaling | None]
    cut: bool


_FORMS = {
    ZoneFormat.FRIGATE: _Form(
        media_type=YAML_TYPE,
        ending="yml",
        open=FrigateText.of,
        slots=frigate_slots,
        text=lambda opened: opened.yaml.edited(),
        template=frigate_template,
        scaling=_shares,
        cut=True,
    ),
    ZoneFormat.GEOJSON: _Form(
        media_type=GEOJSON_TYPE,
        ending="geojson",
        open=copy.deepcopy,
        slots=geojson_slots,
        text=_json_text,
        template=geojson_template,
        scaling=scaling_of,
        cut=False,
    ),
    ZoneFormat.AXIS: _Form(
        media_type=AXIS_TYPE,
        ending="axis.json",
        open=copy.deepcopy,
        slots=axis_slots,
        text=_json_text,
        template=axis_template,
        scaling=_axis_scaling,
        cut=True,
    ),
}


def format_of(named: ZoneFormat | None, media_type: str) -> ZoneFormat | None:
    """The format of a body: the named one, else the one of its media type; None is our own.

    Raises:
        UnsupportedMediaTypeError: the named format has another media type.
    """
    by_type = next((kind for kind in ZoneFormat if _FORMS[kind].media_type == media_type), None)
    if named and by_type and named != by_type:
        needed = f"{_FORMS[named].media_type} or {JSON_TYPE} is needed for format={named}"
        raise UnsupportedMediaTypeError(f"Content-Type: {needed}, got {media_type}")
    return named or by_type


def is_cut(kind: ZoneFormat) -> bool:
    """True of a format in which nothing may be outside the picture."""
    return _FORMS[kind].cut


def media_type_of_zones(kind: ZoneFormat) -> str:
    """The media type of a format."""
    return _FORMS[kind].media_type


def file_name(kind: ZoneFormat, camera_id: str) -> str:
    """The name of a file of a camera's zones."""
    return f"{camera_id}-zones.{_FORMS[kind].ending}"


def read_document(
    kind: ZoneFormat | None,
    body: bytes,
    media_type: str,
    camera_id: str,
    camera_id_of: Callable[[str], str],
) -> Any:
    """The document in a body, as it is kept.

    Args:
        kind: its format; None is our own JSON.
        body: of the request.
        media_type: of the body.
        camera_id: whose zones are wanted.
        camera_id_of: maps a camera's name in another system to a camera id.

    Raises:
        MalformedError: the body is not of its media type, or nested too deep.
        TooLargeError: more YAML than `MAX_BYTES`.
    """
    if kind == ZoneFormat.FRIGATE:
        return frigate_document(_yaml_text(body, media_type), camera_id, camera_id_of)
    return _json_value(body)


def _yaml_text(body: bytes, media_type: str) -> str:
    if len(body) > MAX_BYTES:
        raise TooLargeError(
            f"body: at most {MAX_BYTES} bytes of YAML are accepted, got {len(body)}"
        )
    if media_type != YAML_TYPE:  # JSON is YAML, once tabs are blanks
        return json.dumps(_json_value(body), ensure_ascii=False, indent=2)
    try:
        return read_yaml_text(body)
    except ValueError as error:
        raise MalformedError(f"body: YAML is needed, {str(error):.200}") from error


def _json_value(body: bytes) -> Any:
    """A JSON value that can be written again: no NaN, no half of a surrogate pair."""
    try:
        value = json.loads(body)
        check_levels(value)
        json.dumps(value, ensure_ascii=False, allow_nan=False).encode()
    except (ValueError, RecursionError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else f"{error!s:.100}"
        raise MalformedError(f"body: JSON is needed, {reason}") from error
    return value


def read_zones(
    kind: ZoneFormat | None, document: Any, picture: tuple[int, int], on: ZoneOn
) -> tuple[Zone, ...]:
    """The zones of a document, in pixels of an image of a size.

    Raises:
        MalformedError: with the place, what is needed and what was received; or the document
            cannot be written back with the same zones.
    """
    if kind is None:
        return zones_of(_own_slots(document), on, scaling_of(document, picture), picture)
    form = _FORMS[kind]
    slots = form.slots(form.open(document))
    found = zones_of(slots, on, form.scaling(document, picture), picture)
    _check_written(kind, document, picture, found)
    return found


def _check_written(
    kind: ZoneFormat, document: Any, picture: tuple[int, int], zones: Sequence[Zone]
) -> None:
    """Write a document once before it is kept: later there is nobody to refuse it to."""
    corners = {zone.id: zone.corners for zone in zones}
    form = _FORMS[kind]
    written = write_zones(kind, document, picture, zones, corners)
    again = {**document, "text": written} if kind == ZoneFormat.FRIGATE else json.loads(written)
    if [slot.id for slot in form.slots(form.open(again))] != list(corners):
        raise refused("", "these zones cannot be written back")


def write_zones(
    kind: ZoneFormat,
    document: Any,
    picture: tuple[int, int],
    zones: Sequence[Zone],
    moved: Mapping[str, Sequence[Corner]] | None,
) -> str:
    """The text of a document with zones where they are now; the rest of it stays as it is.

    Args:
        kind: the format.
        document: as `read_document` made it; None if the zones came in another format.
        picture: width and height of the image.
        zones: as they were drawn.
        moved: corners in pixels by zone id. A zone with too few is left out. None if the camera
            has not moved: the document is as it came.
    """
    form = _FORMS[kind]
    opened = form.open(form.template(zones) if document is None else document)
    if document is None or moved is not None:
        corners = {zone.id: zone.corners for zone in zones} if moved is None else moved
        fewest = {zone.id: min(len(zone.corners), 3) for zone in zones}  # a line has two
        scaling = form.scaling(document, picture)
        for slot in list(form.slots(opened)):
            found = corners.get(slot.id, ())
            if len(found) < fewest[slot.id]:
                slot.drop()
            else:
                slot.put(scaled(found, scaling, back=True))
    return form.text(opened)


def _own_slots(document: Any) -> Iterator[Slot]:
    """The zones of our own JSON."""
    zones = document.get("zones") if isinstance(document, dict) else None
    if not isinstance(zones, list):
        raise refused("/zones", "a list of zones is needed")
    for number, zone in enumerate(zones):
        if not isinstance(zone, dict):
            raise refused(f"/zones/{number}", "an object with id and points is needed")
        yield Slot(
            id=zone.get("id"),
            pointer=f"/zones/{number}",
            corners=zone.get("points"),
            put=lambda corners: None,
            drop=lambda: None,
            on=zone.get("on"),
        )
