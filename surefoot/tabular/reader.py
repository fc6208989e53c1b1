"""Tracks of a table: its layout is given, named by its header, or recognised by its values."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array, Index, Mask
from surefoot.people import PEDESTRIANS, PersonClasses, SkipReason
from surefoot.tabular import columns as roles
from surefoot.tabular.choice import ask_classes, by_content, check_fit
from surefoot.tabular.facts import Facts
from surefoot.tabular.head import Head, is_missing, read_head
from surefoot.tabular.layouts import MOT, Layout, LayoutError, in_usual_order
from surefoot.tabular.lines import Bounds, Lines, Plan, check_lines, read_lines
from surefoot.tabular.recognition import known_layout, plan_of

_MOST_NAMED = 12  # classes in a message


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the caller knows of a table.

    `layout` is a layout's name or a list of columns. `normalised` numbers are shares of the image,
    which count from 0.
    """

    frame_rate_hz: float | None = None
    started_at_s: float | None = None
    layout: str | None = None
    classes: PersonClasses | None = None
    normalised: bool = False
    bounds: Bounds = Bounds()


@dataclass(frozen=True, slots=True, kw_only=True)
class TableTracks:
    """The tracks of a table, in the order of their first lines.

    `rows` are, for each track, time in s, u, v of the foot (N, 3) or time and box (N, 5), in the
    order of time and in pixels that count from 0; the table's counted from `first_px`. A track in
    `broken` has a line that cannot be read. `skipped` counts whole tracks that have no line to
    use; `other_classes` are the first classes that are no person.
    """

    rows: dict[str, Array]
    broken: dict[str, str]
    skipped: Counter[SkipReason]
    other_classes: tuple[str, ...] = ()
    first_px: int = 0


def read_table(body: bytes, options: Options) -> TableTracks:
    """Read the tracks of a table of text.

    Raises:
        LayoutError: no line can be read, or the layout, the classes or the clock are not known.
        TooManyError: the table is larger than the bounds.
    """
    check_lines(body, options.bounds)
    head = read_head(body)
    named = any(map(roles.role_of, head.header or ()))
    if named and not len(head.sample):
        return TableTracks(rows={}, broken={}, skipped=Counter())
    layout, shifted = known_layout(head, options.layout)
    _check_clock(layout, options)
    plan = plan_of(head, layout, shifted)
    lines = read_lines(body, head, plan, options.bounds)
    if lines.broken and not len(lines):
        first = next(iter(lines.broken.values()))
        raise LayoutError("", f"not a table of tracks: {first}")
    if not len(lines):
        return TableTracks(rows={}, broken={}, skipped=Counter())
    with np.errstate(over="ignore", invalid="ignore"):  # those tracks are rejected by name
        return _tracks_in(lines, head, layout, plan, shifted, options)


def _tracks_in(
    lines: Lines, head: Head, layout: Layout | None, plan: Plan, shifted: int, options: Options
) -> TableTracks:
    names, tracks = _merged(lines)
    if head.header is None and in_usual_order(layout):
        ids = np.array([_as_number(name) for name in names])[tracks]
        values = np.insert(lines.numbers(len(plan.numbers)), 1, ids, axis=1)
        facts = Facts(values=values, count=head.count - shifted, tracks=tracks)
        layout = _by_values(layout, facts, options)
    assert layout is not None
    numbers = lines.numbers(len(plan.numbers))
    by_role = {
        role: numbers[:, plan.numbers.index(at + shifted)]
        for at, role in enumerate(layout.columns)
        if role != roles.UNUSED and at + shifted in plan.numbers
    }
    return _tracks_of(lines, names, tracks, by_role, layout, options)


def _check_clock(layout: Layout | None, options: Options) -> None:
    if "frame" not in (MOT if layout is None else layout).columns:
        return
    given = {"frame_rate_hz": options.frame_rate_hz, "started_at": options.started_at_s}
    for name, value in given.items():
        if value is None:
            raise LayoutError(name, "is needed, because the table has frame numbers, not times")


def _by_values(layout: Layout | None, facts: Facts, options: Options) -> Layout:
    """Return the layout that fits the values of all lines, or check the one of the request."""
    if layout is None:
        return by_content(facts, classes_given=options.classes is not None)
    check_fit(layout, facts)
    if layout.classes is None and options.classes is None:
        raise ask_classes(layout, facts)
    return layout


def _merged(lines: Lines) -> tuple[list[str], Index]:
    """Return the ids of all tracks and the number of each line's; `7.0` and `7` are one id."""
    given = list(lines.names)
    plain = [_plain_id(name) for name in given]
    if plain == given:
        return given, lines.tracks
    merged: dict[str, int] = {}
    numbers = np.array([merged.setdefault(name, len(merged)) for name in plain], dtype=np.int64)
    for name in [name for name in lines.broken if _plain_id(name) != name]:
        lines.broken.setdefault(_plain_id(name), lines.broken.pop(name))
    return list(merged), numbers[lines.tracks]


def _plain_id(name: str) -> str:
    """Return an id that a writer of floats wrote as the whole number that it is."""
    if not name.isascii() or name.isdecimal() or not any(mark in name for mark in ".e"):
        return name
    try:
        number = float(name)
    except ValueError:
        return name
    return f"{number:.0f}" if number.is_integer() and abs(number) < 2**53 else name


def _as_number(name: str) -> float:
    return float(name) if name.isascii() and name.isdecimal() else np.nan


def _tracks_of(
    lines: Lines,
    names: list[str],
    tracks: Index,
    by_role: dict[str, Array],
    layout: Layout,
    options: Options,
) -> TableTracks:
    persons, others = _persons(lines, by_role, layout, options)
    used = persons.copy()
    for role, ignored in (("conf", 0.0), ("lost", 1.0)):
        if role in by_role:
            used &= by_role[role] != ignored
    tracked = np.array([name not in ("-1", "") and not is_missing(name) for name in names])
    whole = np.array([name not in lines.broken for name in names]) & tracked
    count = len(names)
    has_person = np.bincount(tracks[persons], minlength=count) > 0
    has_used = np.bincount(tracks[used], minlength=count) > 0
    reasons = {
        SkipReason.NO_ID: ~tracked,
        SkipReason.NOT_A_PERSON: whole & ~has_person,
        SkipReason.CONFIDENCE: whole & has_person & ~has_used,
    }
    used &= whole[tracks]
    rows = _rows({role: column[used] for role, column in by_role.items()}, layout, options)
    of = tracks[used]
    order = np.lexsort((rows[:, 0], of))
    rows = rows[order]
    ends = np.cumsum(np.bincount(of, minlength=count)).tolist()
    spans = {
        name: rows[begin:end]
        for name, begin, end in zip(names, [0, *ends], ends, strict=False)
        if end > begin or name in lines.broken
    }
    return TableTracks(
        rows=spans,
        broken=lines.broken,
        skipped=Counter({why: int(which.sum()) for why, which in reasons.items() if which.any()}),
        other_classes=others,
        first_px=0 if options.normalised else layout.first,
    )


def _persons(
    lines: Lines, by_role: dict[str, Array], layout: Layout, options: Options
) -> tuple[Mask, tuple[str, ...]]:
    """Return which lines (N,) are of pedestrians, and the first classes of the others.

    Raises:
        LayoutError: class 1 is in the table and 0 is not, so the numbers may begin at 1.
    """
    classes = options.classes or layout.classes or PEDESTRIANS
    if lines.labels:
        kind = np.array([classes.include(label) for label in lines.labels])
        others = [label for label, person in zip(lines.labels, kind, strict=True) if not person]
        return kind[lines.texts], tuple(others[:_MOST_NAMED])
    column = by_role.get("class")
    if column is None:
        return np.ones(len(lines), dtype=bool), ()
    found, inverse = np.unique(column, return_inverse=True)
    numbers = [None if np.isnan(number) else number for number in found.tolist()]
    kind = np.array(
        [each is None or np.isfinite(each) and classes.include(each) for each in numbers]
    )
    by_default = options.classes is None and layout.classes is PEDESTRIANS
    if by_default and 1 in numbers and not kind.any():
        listed = ", ".join(f"{number:g}" for number in found[:_MOST_NAMED])
        raise LayoutError(
            "classes",
            "the class numbers can count from 0 (COCO: 1 is a bicycle) or from 1 (1 is a "
            f"person): use classes=0 or classes=1; the table has classes {listed}",
        )
    others = [f"{number:g}" for number, person in zip(found, kind, strict=True) if not person]
    return kind[inverse], tuple(others[:_MOST_NAMED])


def _rows(by_role: dict[str, Array], layout: Layout, options: Options) -> Array:
    """Return time, u, v (N, 3) or time and box (N, 5), in pixels that count from 0."""
    first = 0 if options.normalised else layout.first
    time_s = _times(by_role, layout, options)
    form = roles.form_of(layout.columns)
    assert form is not None
    one, two = by_role[form[0]] - first, by_role[form[1]] - first
    if form == roles.FOOT:
        return np.column_stack([time_s, one, two])
    three, four = by_role[form[2]], by_role[form[3]]
    if form == roles.CENTRE:
        one, two = one - three / 2, two - four / 2
    if form != roles.CORNERS:
        three, four = one + three, two + four
    return np.column_stack([time_s, one, two, three, four])


def _times(by_role: dict[str, Array], layout: Layout, options: Options) -> Array:
    if "time_s" in by_role:
        return by_role["time_s"]
    if "time_ms" in by_role:
        return by_role["time_ms"] / 1000.0
    assert options.frame_rate_hz is not None
    assert options.started_at_s is not None
    return options.started_at_s + (by_role["frame"] - layout.first) / options.frame_rate_hz
