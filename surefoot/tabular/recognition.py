"""The layout of a table as far as its first lines show it, and the columns to read."""

import numpy as np

from surefoot.tabular import columns as roles
from surefoot.tabular.choice import by_head, check_count, of_columns, read_layout
from surefoot.tabular.facts import Facts
from surefoot.tabular.head import Head
from surefoot.tabular.layouts import MOT, Layout, LayoutError, in_usual_order
from surefoot.tabular.lines import Plan

_WIDEST = 10  # columns of a table without a header that are read
_REQUIRED = 9  # of them, those that have to be numbers: up to the class or the visibility
_OPTIONAL = frozenset(("conf", "class", "lost", "visibility", "truncation", "occlusion"))
_FEWEST = 6


def known_layout(head: Head, text: str | None) -> tuple[Layout | None, int]:
    """Return the layout that is known before all lines are read, and the columns before it.

    None if the values of all lines have to identify it. An index that a data frame writes is a
    column before the others.

    Raises:
        LayoutError: the header or the layout in the query cannot be used.
    """
    given = None if text is None else read_layout(text)
    if head.header is not None:
        return _of_header(head, given), 0
    if not head.count:
        return given, 0
    if in_usual_order(given) and _has_index(head, given):
        return given, 1
    facts = Facts(
        values=head.sample,
        count=head.count,
        tracks=np.zeros(len(head.sample), dtype=np.int64),
    )
    by_order = by_head(head.texts, facts)
    if given is not None:
        check_count(given, head.count)
        if given.name in ("kitti", "sdd", "towncentre", "aicity") and given is not by_order:
            raise LayoutError("layout", f"{given.name} does not fit the values of the table")
        return given, 0
    if by_order is None and head.count < _FEWEST:
        raise LayoutError(
            "",
            f"not a table of tracks: line 1 has {head.count} columns separated by "
            f"{head.separated_by}; at least {_FEWEST} are needed (frame, id, left, top, width, "
            "height), or a header that names them",
        )
    texts = [at for at, text in enumerate(head.texts) if text and at != 1]
    if by_order is None and texts in ([6], [7]):
        return _with_class_name(head, facts, texts[0]), 0
    return by_order, 0


def plan_of(head: Head, layout: Layout | None, shifted: int) -> Plan:
    """Return the columns to read; of a table that its values identify, all that may be used."""
    if head.header is None and in_usual_order(layout):
        until = min(head.count, _WIDEST + shifted)
        numbers = tuple(at for at in range(shifted, until) if at != 1 + shifted)
        named = MOT.columns[:6] if layout is None else layout.columns
        free = list(range(_REQUIRED, _WIDEST))
        if layout is not None:
            free = [at for at in range(6, _WIDEST) if layout.at(roles.UNUSED, at + 1) == at]
        needed = range(_REQUIRED) if layout is None else range(len(named))
        return Plan(
            id_at=1 + shifted,
            numbers=numbers,
            needed=frozenset(
                at + shifted for at in needed if at >= len(named) or named[at] not in _OPTIONAL
            ),
            free=frozenset(at + shifted for at in free),
        )
    assert layout is not None
    class_at = layout.at("class", head.count)
    text_at = class_at if class_at is not None and head.some_text[class_at] else None
    used = {
        at: role
        for at, role in enumerate(layout.columns[: head.count])
        if role not in (roles.UNUSED, "id") and at != text_at
    }
    return Plan(
        id_at=layout.columns.index("id"),
        numbers=tuple(used),
        needed=frozenset(at for at, role in used.items() if role not in _OPTIONAL),
        text_at=text_at,
    )


def _of_header(head: Head, given: Layout | None) -> Layout:
    names = list(head.header or ())
    if len(names) == head.count + 1 and not names[-1]:
        names.pop()
    if len(names) == head.count - 1:  # R names rows, and does not name their column
        names.insert(0, "")
    if len(names) != head.count:
        raise LayoutError(
            "layout", f"the header has {len(names)} columns, the lines have {head.count}"
        )
    found = roles.roles_of(names)
    if given is not None:
        check_count(given, head.count)
        _check_header(found, given)
        return given
    if roles.form_of(found) is None and set(roles.NEITHER_CORNER_NOR_CENTRE) <= set(found):
        readings = []
        for left, top in (("left", "top"), ("centre_u", "centre_v")):
            named = {"x": left, "y": top}
            listed = ",".join(named.get(role, role) for role in found)
            readings.append(f"layout={listed}")
        raise LayoutError(
            "layout",
            "x, y beside width and height can be the upper left corner or the centre of a box: "
            f"use {' or '.join(readings)}",
        )
    rest = tuple(roles.UNUSED if role in ("x", "y") else role for role in found)
    form = roles.form_of(rest)
    if form == roles.CORNERS:  # sides that are given, too, add nothing
        rest = tuple(roles.UNUSED if role in ("width", "height") else role for role in rest)
    if "time_s" in rest or "time_ms" in rest:
        rest = tuple(roles.UNUSED if role == "frame" else role for role in rest)
    return of_columns(rest, "header")


def _check_header(found: tuple[str, ...], given: Layout) -> None:
    """Refuse a layout that gives another meaning to a column than the header does."""
    for at, (named, asked) in enumerate(zip(found, given.columns, strict=False), start=1):
        unclear = {roles.UNUSED, "x", "y"}
        if named not in unclear and asked not in unclear and named != asked:
            raise LayoutError(
                "layout", f"column {at} is {named} by the header and {asked} by the layout"
            )


def _has_index(head: Head, given: Layout | None) -> bool:
    """Return True if the first column only counts the lines, as a data frame's index does.

    Raises:
        LayoutError: it may be the frame of a single track as well.
    """
    sample = head.sample
    if head.count < 7 or len(sample) < 5 or any(head.texts[:7]):
        return False
    if given is not None and given.fewest <= head.count <= len(given.columns):
        return False
    first = sample[:, 0]
    counts = first[0] in (0, 1) and bool((np.diff(first) == 1).all())
    whole = bool((sample[:, 1:3] == np.round(sample[:, 1:3])).all())
    if not counts or not whole:
        return False

    def repeats(at: int) -> bool:
        return len(np.unique(sample[:, at])) * 5 <= len(sample)

    if not repeats(2) or len(np.unique(sample[:, 1])) < 2:
        return False
    if repeats(1) and given is None:
        raise LayoutError(
            "layout",
            "column 1 counts the lines: it can be the frame or an index; "
            "use layout=mot or list the columns, with - for the index",
        )
    return not repeats(1)


def _with_class_name(head: Head, facts: Facts, at: int) -> Layout:
    """Return MOTChallenge's order of columns, with class names in column 7 or 8."""
    rest = ["class"] if at == 6 else ["conf", "class"]
    rest += [roles.UNUSED] * (head.count - 6 - len(rest))
    if facts.corners >= 0.9:
        ends = ",".join(rest)
        raise LayoutError(
            "layout",
            "columns 5 and 6 can be width and height or the right and bottom edge: use "
            f"layout=frame,id,left,top,width,height,{ends} or "
            f"layout=frame,id,left,top,right,bottom,{ends}",
        )
    return of_columns((*MOT.columns[:6], *rest), "columns")
