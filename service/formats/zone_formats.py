"""Zones in the documents of other systems, by name: read, and written anew with other corners."""

import copy
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import yaml

from service.enums import ZoneOn
from service.errors import MalformedError, TooLargeError
from service.formats.zones import Corner, Slot, Zone, refused, zones_of
from service.formats.zones_axis import axis_slots, axis_template
from service.formats.zones_frigate import frigate_slots, frigate_template
from service.formats.zones_geojson import geojson_slots, geojson_template

_MOST_YAML = 64 * 1024  # bytes: PyYAML holds every thread up meanwhile
_DEEPEST = 32  # levels; Frigate's have seven
JSON_TYPE, YAML_TYPE = "application/json", "application/yaml"
GEOJSON_TYPE, AXIS_TYPE = "application/geo+json", "application/vnd.surefoot.axis-zones+json"


class ZoneFormat(StrEnum):
    """The formats of zones beside our own JSON."""

    FRIGATE = "frigate"
    GEOJSON = "geojson"
    AXIS = "axis"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """A format; `to` and `of` are from its numbers to pixels and back, of pictures of a size."""

    media_type: str
    ending: str
    slots: Callable[[Any, str], Iterator[Slot]]
    template: Callable[[Sequence[Zone]], Any]
    to: Callable[[Corner, int, int], Corner]
    of: Callable[[Corner, int, int], Corner]
    cut: bool  # whether nothing may be outside the picture


_FORMS = {
    ZoneFormat.FRIGATE: _Form(
        media_type=YAML_TYPE,
        ending="yml",
        slots=frigate_slots,
        template=frigate_template,
        to=lambda at, w, h: (at[0] * w - 0.5, at[1] * h - 0.5),
        of=lambda at, w, h: ((at[0] + 0.5) / w, (at[1] + 0.5) / h),
        cut=True,
    ),
    ZoneFormat.GEOJSON: _Form(
        media_type=GEOJSON_TYPE,
        ending="geojson",
        slots=geojson_slots,
        template=geojson_template,
        to=lambda at, w, h: at,
        of=lambda at, w, h: at,
        cut=False,
    ),
    ZoneFormat.AXIS: _Form(
        media_type=AXIS_TYPE,
        ending="axis.json",
        slots=axis_slots,
        template=axis_template,
        to=lambda at, w, h: ((at[0] + 1) / 2 * w - 0.5, (1 - at[1]) / 2 * h - 0.5),
        of=lambda at, w, h: (2 * (at[0] + 0.5) / w - 1, 1 - 2 * (at[1] + 0.5) / h),
        cut=True,
    ),
}


def format_of(said: ZoneFormat | None, media_type: str) -> ZoneFormat | None:
    """The format of a document: as it is said, else by its media type; None is our own."""
    return said or next(
        (kind for kind in ZoneFormat if _FORMS[kind].media_type == media_type), None
    )


def is_cut(kind: ZoneFormat) -> bool:
    """True of a format in which nothing may be outside the picture."""
    return _FORMS[kind].cut


def media_type_of_zones(kind: ZoneFormat) -> str:
    """The media type of a format."""
    return _FORMS[kind].media_type


def file_name(kind: ZoneFormat, camera_id: str) -> str:
    """The name of a file of a camera's zones."""
    return f"{camera_id}-zones.{_FORMS[kind].ending}"


def parsed(body: bytes, media_type: str) -> Any:
    """The value of a body, of YAML where its type says so.

    Raises:
        MalformedError: it is neither.
        TooLargeError: more YAML than may be.
    """
    try:
        if media_type != YAML_TYPE:
            return _plain(json.loads(body))
        if len(body) > _MOST_YAML:
            words = f"at most {_MOST_YAML} bytes of YAML are taken, got {len(body)}"
            raise TooLargeError(f"body: {words}")
        _check_yaml(body)
        return _plain(yaml.safe_load(body))
    except (ValueError, TypeError, RecursionError, yaml.YAMLError) as error:
        what = "YAML with keys that are text" if media_type == YAML_TYPE else "JSON"
        raise MalformedError(f"body: {what} is needed, {str(error):.100}") from error


def _check_yaml(body: bytes) -> None:
    """Refuse what is small as text alone.

    A few hundred bytes of aliases are gigabytes once they are written out, and brackets within
    brackets take the square of their number: 64 KiB of them half an hour.
    """
    depth = 0
    for event in yaml.parse(body, Loader=yaml.CSafeLoader):
        if isinstance(event, yaml.AliasEvent):
            raise ValueError("aliases are not taken")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise ValueError(f"at most {_DEEPEST} levels are taken")


def _plain(value: Any) -> Any:
    """A value of what JSON has: no NaN, no half of a surrogate pair, no time and no bytes."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    return json.loads(text.encode())


def read_zones(
    kind: ZoneFormat | None, document: Any, camera_id: str, picture: tuple[int, int], on: ZoneOn
) -> tuple[Zone, ...]:
    """The zones of a document, in pixels of a picture of a size.

    Raises:
        MalformedError: with the place, what is needed and what came.
    """
    if kind is None:
        return zones_of(_own_slots(document), on, lambda at: at, picture)
    form = _FORMS[kind]
    return zones_of(form.slots(document, camera_id), on, lambda at: form.to(at, *picture), picture)


def write_zones(
    kind: ZoneFormat,
    document: Any,
    camera_id: str,
    picture: tuple[int, int],
    zones: Sequence[Zone],
    moved: Mapping[str, Sequence[Corner]] | None,
) -> str:
    """The text of a document with zones where they are now; what is not a zone stays as it is.

    `document` is as it came, if it came in this format. `moved` has, by their ids, the corners that
    zones have by now, in pixels: without any, a zone is left out. None where nothing has moved: the
    document is as it came.
    """
    form = _FORMS[kind]
    made = copy.deepcopy(form.template(zones) if document is None else document)
    if document is None or moved is not None:
        corners = {zone.id: zone.corners for zone in zones} if moved is None else moved
        fewest = {zone.id: min(len(zone.corners), 3) for zone in zones}  # a line has two
        for slot in list(form.slots(made, camera_id)):
            found = corners.get(slot.id, ())
            if len(found) < fewest[slot.id]:
                slot.drop()
            else:
                slot.put([form.of(each, *picture) for each in found])
    if form.media_type == YAML_TYPE:
        return str(yaml.safe_dump(made, sort_keys=False, allow_unicode=True, width=1_000_000))
    return json.dumps(made, ensure_ascii=False)


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
