"""Angles of JSON columns from degrees to radians and back; frozen, as migrations are."""

import math
from collections.abc import Callable
from typing import Any

import sqlalchemy as sa

_BITE = 1000


def turn(
    connection: sa.Connection,
    table: sa.TableClause,
    column: str,
    change: Callable[[Any], Any],
) -> None:
    """Change a JSON column of all rows, so many at a time."""
    key, last = table.c.id, None
    update = (
        sa.update(table).where(key == sa.bindparam("row")).values({column: sa.bindparam("new")})
    )
    while True:
        query = sa.select(key, table.c[column]).order_by(key).limit(_BITE)
        rows = connection.execute(query if last is None else query.where(key > last)).all()
        if not rows:
            return
        last = rows[-1][0]
        connection.execute(update, [{"row": row, "new": change(body)} for row, body in rows])


def to_radians(body: Any) -> Any:
    """A body whose fields `*_deg` are `*_rad`, in bodies within it too; the rest as it is."""
    return _renamed(body, "_deg", "_rad", _radians)


def to_degrees(body: Any) -> Any:
    """The way back."""
    return _renamed(body, "_rad", "_deg", math.degrees)


def _renamed(body: Any, old: str, new: str, change: Callable[[float], float]) -> Any:
    if not isinstance(body, dict):
        return body
    found = {}
    for name, value in body.items():
        if name.endswith(old):
            found[name.removesuffix(old) + new] = None if value is None else change(value)
        else:
            found[name] = _renamed(value, old, new, change)
    return found


def _radians(degrees: float) -> float:
    """The radians that are told as the same degrees, digit by digit, where there are such."""
    near = math.radians(degrees)
    beside = (near, math.nextafter(near, math.inf), math.nextafter(near, -math.inf))
    return next((value for value in beside if math.degrees(value) == degrees), near)
