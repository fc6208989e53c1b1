"""Areas and lines in a configuration of AXIS Object Analytics or Video Motion Detection 4.

Corners are -1 to 1, x right and y up. Source: developer.axis.com, VAPIX, "AXIS Object analytics
API": `scenarios` with `triggers` and `filters` that have `vertices`; "Video motion detection 4":
`profiles`, likewise, whose corners are in `data`. An answer of `getConfiguration` has them in
`data`, a request of `setConfiguration` in `params`.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from service.formats.zones import Corner, Slot, Zone, refused

_DIGITS = 5
_KINDS = (("scenarios", "vertices"), ("profiles", "data"))


def axis_slots(document: Any) -> Iterator[Slot]:
    """The areas and lines of all scenarios; one with several has them numbered from the second."""
    part, pointer = document, ""
    for wrapper in ("data", "params"):
        if isinstance(document, dict) and isinstance(document.get(wrapper), dict):
            part, pointer = document[wrapper], f"/{wrapper}"
    has = part if isinstance(part, dict) else {}
    group, key = next((kind for kind in _KINDS if isinstance(has.get(kind[0]), list)), ("", ""))
    if not group:
        raise refused(pointer, "Axis' scenarios or profiles are needed, a list")
    for number, scenario in enumerate(part[group]):
        if not isinstance(scenario, dict):
            raise refused(f"{pointer}/{group}/{number}", "an object is needed")
        name, count = scenario.get("name"), 0
        for kind in ("triggers", "filters"):
            shapes = scenario.get(kind) or []
            for at, shape in enumerate(list(shapes) if isinstance(shapes, list) else []):
                corners = shape.get(key) if isinstance(shape, dict) else None
                if not isinstance(corners, list):
                    continue  # a size, a time: no shape
                count += 1
                yield Slot(
                    id=name if count == 1 else f"{name} {count}",
                    pointer=f"{pointer}/{group}/{number}/{kind}/{at}/{key}",
                    corners=corners,
                    put=_put(shape, key),
                    drop=_drop(shapes, shape),
                )


def axis_template(zones: Sequence[Zone]) -> Any:
    """A configuration of zones, whose corners are to be put in."""
    kinds = ["fence" if len(zone.corners) == 2 else "includeArea" for zone in zones]
    return {
        "scenarios": [
            {"name": zone.id, "triggers": [{"type": kind, "vertices": [[0, 0], [0, 0]]}]}
            for zone, kind in zip(zones, kinds, strict=True)
        ]
    }


def _put(shape: Any, key: str) -> Any:
    def put(corners: Sequence[Corner]) -> None:
        shape[key] = [[round(x, _DIGITS), round(y, _DIGITS)] for x, y in corners]

    return put


def _drop(shapes: list[Any], shape: Any) -> Any:
    return lambda: shapes.pop(next(n for n, each in enumerate(shapes) if each is shape))
