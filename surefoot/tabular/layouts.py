"""Layouts of tables of tracks: their columns, their class numbers, and how each is recognised.

A table without a header is compared with every layout of its number of columns. Exactly one has to
fit: if two fit, or none, the caller is asked (`?layout=`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from surefoot.people import PEDESTRIANS, PersonClasses
from surefoot.tabular.columns import SIZE, UNUSED, form_of, role_of
from surefoot.tabular.facts import Facts

_SIZE = "frame,id,left,top,width,height"
_CORNERS = "frame,id,left,top,right,bottom"
_GROUND_TRUTH = PersonClasses(numbers=frozenset((1, 7)))  # 7: a person who stands
_VISDRONE = PersonClasses(numbers=frozenset((1, 2)))


class LayoutError(Exception):
    """A table that cannot be read as asked; `field` is the parameter to change."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(reason)
        self.field = field
        self.reason = reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """The columns of a table.

    `fewest` columns are enough; the others may be missing. Frames and pixels count from `first`.
    `classes` is None if the class numbers mean something else in each file.
    """

    name: str
    columns: tuple[str, ...]
    fewest: int
    meaning: str
    first: int = 1
    classes: PersonClasses | None = PEDESTRIANS
    fits: Callable[[Facts], bool] = lambda _: True

    def at(self, role: str, count: int) -> int | None:
        """Return the index of a column in a table of so many columns, None if it has none."""
        found = self.columns.index(role) if role in self.columns else count
        return found if found < count else None


def _mot(facts: Facts) -> bool:
    if facts.count <= 7:
        return True
    if facts.count in (9, 10) and facts.all(7, -1):
        return True
    if facts.count != 10:
        return False
    # Columns 8 to 10 may be a place in the world: it has fractions, or moves.
    moves = not facts.all(8, -1) and facts.constant_by_track(7) < 0.5
    return facts.seldom_whole(7) or moves or all(map(facts.zero, (7, 8, 9)))


def _boxmot(facts: Facts) -> bool:
    if facts.count not in (8, 9) or not facts.classes(7):
        return False
    if facts.count == 8:
        return not facts.sides_again
    constant = facts.all(8, -1) or facts.all(8, 0) or facts.all(8, 1)
    return facts.all(8, -1) or constant and (not facts.flags(6) or facts.zero(8))


def _conf_last(facts: Facts) -> bool:
    shape = facts.count == 9 and facts.all(6, 1) and facts.classes(7)
    if not shape or not facts.within(8, 0, 1, above=0):
        return False
    # Ground truth has no class 0. Without it, a few values of exactly 1 are visibilities.
    return facts.has(7, 0) or facts.all(8, 1) or not facts.has(8, 1)


def _ground_truth(facts: Facts) -> bool:
    shape = facts.count == 9 and facts.flags(6) and facts.whole_within(7, 1, 13)
    return shape and facts.within(8, 0, 1)


def _cvat(facts: Facts) -> bool:
    shape = facts.count == 9 and facts.flags(6) and facts.classes(7) and not facts.has(7, 0)
    return shape and facts.flags(8)


def _mcmot(facts: Facts) -> bool:
    return facts.count == 10 and facts.classes(7) and facts.all(8, -1) and facts.all(9, -1)


def _visdrone(facts: Facts) -> bool:
    shape = facts.count == 10 and facts.whole_within(7, 0, 11)
    shape = shape and facts.whole_within(8, -1, 1) and facts.whole_within(9, -1, 2)
    # Results have no class 0, which marks regions to ignore in the ground truth.
    return shape and not (facts.has(7, 0) and facts.all(8, -1) and facts.all(9, -1))


def _columns(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


LAYOUTS = (
    Layout(
        name="mot",
        columns=_columns(f"{_SIZE},conf,-,-,-"),
        fewest=6,
        meaning="MOTChallenge results, without a class",
        fits=_mot,
    ),
    Layout(
        name="mot-gt",
        columns=_columns(f"{_SIZE},conf,class,visibility"),
        fewest=9,
        meaning="MOTChallenge ground truth: classes 1 and 7 are people, column 9 is the visibility",
        classes=_GROUND_TRUTH,
        fits=_ground_truth,
    ),
    Layout(
        name="cvat",
        columns=_columns(f"{_SIZE},conf,class,visibility"),
        fewest=9,
        meaning="a MOT export of CVAT: class numbers are the lines of its labels.txt, from 1",
        classes=None,
        fits=_cvat,
    ),
    Layout(
        name="boxmot",
        columns=_columns(f"{_SIZE},conf,class,-"),
        fewest=8,
        meaning="BoxMOT: column 7 is the confidence, class 0 is a person",
        fits=_boxmot,
    ),
    Layout(
        name="conf-last",
        columns=_columns(f"{_SIZE},-,class,conf"),
        fewest=9,
        meaning="column 9 is the confidence, class 0 is a person",
        fits=_conf_last,
    ),
    Layout(
        name="mcmot",
        columns=_columns(f"{_SIZE},conf,class,-,-"),
        fewest=10,
        meaning="MCMOT: class 0 is a person",
        fits=_mcmot,
    ),
    Layout(
        name="visdrone",
        columns=_columns(f"{_SIZE},conf,class,truncation,occlusion"),
        fewest=10,
        meaning="VisDrone: classes 1 (pedestrian) and 2 (people) are people",
        classes=_VISDRONE,
        fits=_visdrone,
    ),
    Layout(
        name="corners",
        columns=_columns(f"{_CORNERS},conf,class"),
        fewest=6,
        first=0,
        meaning="columns 5 and 6 are the right and bottom edge",
        fits=lambda facts: facts.corners >= 0.5,
    ),
    Layout(
        name="corners-size",
        columns=_columns(f"{_CORNERS},-,-"),
        fewest=8,
        first=0,
        meaning="left, top, right and bottom edge, then width and height",
        fits=lambda facts: facts.count == 8 and facts.sides_again,
    ),
    Layout(
        name="kitti",
        columns=_columns("frame,id,class,-,-,-,left,top,right,bottom"),
        fewest=17,
        first=0,
        meaning="KITTI tracking: column 3 is the class's name",
    ),
    Layout(
        name="sdd",
        columns=_columns("id,left,top,right,bottom,frame,lost,-,-,class"),
        fewest=10,
        first=0,
        meaning="Stanford Drone Dataset: column 10 is the class's name",
    ),
    Layout(
        name="towncentre",
        columns=_columns("id,frame,-,conf,-,-,-,-,left,top,right,bottom"),
        fewest=12,
        first=0,
        meaning="Oxford Town Centre: head and body of each person",
    ),
    Layout(
        name="aicity",
        columns=_columns("-,id,frame,left,top,width,height,-,-"),
        fewest=9,
        first=0,
        meaning="AI City Challenge: column 1 is the camera, column 3 the frame",
    ),
)
_BY_NAME = {layout.name: layout for layout in LAYOUTS}
MOT, CORNERS = _BY_NAME["mot"], _BY_NAME["corners"]
# With frame, id and box first, so that the values of the other columns identify them.
_IN_ORDER = tuple(layout for layout in LAYOUTS if layout.columns[:4] == MOT.columns[:4])


def in_usual_order(layout: Layout | None) -> bool:
    """True for a known layout with frame, id and box first; its values identify it."""
    return layout is None or layout in _IN_ORDER


def read_layout(text: str) -> Layout:
    """Return the layout of a name, or of a list of columns such as `frame,id,x1,y1,x2,y2`.

    Raises:
        LayoutError: the name or a column is unknown, or the columns do not make a track.
    """
    if text in _BY_NAME:
        return _BY_NAME[text]
    names = [name.strip() for name in text.split(",")]
    if len(names) == 1:
        known = ", ".join(_BY_NAME)
        needed = f"one of {known}, or a list of columns such as {_CORNERS},conf"
        raise LayoutError("layout", f"must be {needed}; got {text!r:.80}")
    columns = tuple(UNUSED if name in ("-", "_") else role_of(name) for name in names[:100])
    if None in columns:
        wrong = names[columns.index(None)]
        raise LayoutError("layout", f"unknown column {wrong!r:.40}; use - for an unused column")
    return of_columns(tuple("class" if c == "class_name" else str(c) for c in columns), "layout")


def of_columns(columns: tuple[str, ...], where: str) -> Layout:
    """Return the layout of a list of columns; `where` names it in an error.

    Raises:
        LayoutError: a column is missing or comes twice.
    """
    used = [role for role in columns if role != UNUSED]
    twice = next((role for role in used if used.count(role) > 1), None)
    if twice is not None:
        raise LayoutError("layout", f"{where}: column {twice} comes twice; use - for one of them")
    form = form_of(columns)
    missing = [] if "id" in columns else ["id"]
    if not {"frame", "time_s", "time_ms"} & set(columns):
        missing.append("frame or time_s")
    if form is None:
        missing.append("left,top,width,height or x1,y1,x2,y2 or u_px,v_px")
    if missing:
        got = ",".join(columns)
        raise LayoutError("layout", f"{where}: missing {' and '.join(missing)}; got {got:.200}")
    return Layout(
        name=",".join(columns),
        columns=columns,
        fewest=len(columns),
        meaning="columns as listed",
        first=1 if form == SIZE else 0,
    )


def by_head(texts: Sequence[bool], facts: Facts) -> Layout | None:
    """Return the layout with another order of columns than MOTChallenge's, None if none fits.

    `texts` tells which columns are text; `facts` are those of the first lines.
    """
    count, found = len(texts), None
    if count in (17, 18) and texts[2] and not any(texts[3:]):
        found = "kitti"
    elif count >= 10 and texts[9] and not any(texts[:9]):
        found = "sdd"
    elif count == 12 and not any(texts) and facts.flags(2) and facts.flags(3):
        found = "towncentre"
    elif count == 9 and not any(texts) and facts.constant(0):
        found = "aicity" if facts.whole_and_varies(2) and facts.seldom_whole(7) else None
    return None if found is None else _BY_NAME[found]


def by_content(facts: Facts, *, classes_given: bool) -> Layout:
    """Return the only layout that fits a table without a header.

    `classes_given`: the request names the classes of people, so there is a class column, and
    layouts that differ in class numbers only are the same.

    Raises:
        LayoutError: none fits, or several do.
    """
    fitting = [each for each in _IN_ORDER if each is not CORNERS and each.fits(facts)]
    with_class = [layout for layout in fitting if "class" in layout.columns]
    if classes_given and with_class:
        fitting = with_class[:1]
    if not fitting:
        raise _unknown(facts)
    readings = [f"layout={layout.name} ({layout.meaning})" for layout in fitting]
    if facts.count in (7, 10) and facts.class_in_seventh and fitting == [MOT]:
        rest = ",-" * (facts.count - 7)
        readings = [
            f"layout={_SIZE},conf{rest} (column 7 is the confidence)",
            f"layout={_SIZE},class{rest} (column 7 is the class)",
        ]
    if facts.corners >= 0.9 and len(fitting) == 1 and fitting[0].columns[4] == "width":
        tail = "".join(f",{role}" for role in fitting[0].columns[6 : facts.count])
        corners = CORNERS.name if facts.count <= 7 else _CORNERS + tail
        readings.append(f"layout={corners} ({CORNERS.meaning})")
    if facts.swapped and len(readings) == 1:
        rest = "".join(f",{role}" for role in fitting[0].columns[2 : facts.count])
        readings = [
            f"layout=frame,id{rest} (column 1 is the frame)",
            f"layout=id,frame{rest} (column 2 is the frame)",
        ]
    if len(readings) > 1:
        raise LayoutError(
            "layout",
            f"the {facts.count} columns can be read in {len(readings)} ways: "
            f"{'; or '.join(readings)}. Name one in the query",
        )
    if fitting[0].classes is None and not classes_given:
        raise ask_classes(fitting[0], facts)
    return fitting[0]


def check_fit(layout: Layout, facts: Facts) -> None:
    """Check that the values of a table fit the layout that the request names.

    Raises:
        LayoutError: they do not.
    """
    check_count(layout, facts.count)
    if not layout.fits(facts):
        raise LayoutError(
            "layout",
            f"{layout.name} ({layout.meaning}) does not fit the values of the table; "
            f"list its columns instead, for example layout={_SIZE},conf",
        )


def check_count(layout: Layout, count: int) -> None:
    """Check that a table has as many columns as the layout that the request names.

    Raises:
        LayoutError: it has not.
    """
    most = max(len(layout.columns), layout.fewest + 1 if layout.name == "kitti" else 0)
    if not layout.fewest <= count <= most:
        needed = f"{layout.fewest}" if layout.fewest == most else f"{layout.fewest} to {most}"
        raise LayoutError("layout", f"{layout.name} has {needed} columns; the table has {count}")


def ask_classes(layout: Layout, facts: Facts) -> LayoutError:
    """Return the error of a table whose class numbers mean something else in each file."""
    return LayoutError(
        "classes",
        f"the class numbers of {layout.name} depend on the file: name the numbers of people in "
        f"the query, for example classes=1; column 8 has {facts.seen(7)}",
    )


def _unknown(facts: Facts) -> LayoutError:
    known = "; ".join(
        f"{layout.name} ({layout.meaning})"
        for layout in LAYOUTS
        if layout.fewest <= facts.count <= max(len(layout.columns), layout.fewest)
    )
    instead = f". Known layouts of {facts.count} columns: {known}" if known else ""
    return LayoutError(
        "layout",
        f"the {facts.count} columns fit no known layout; list them in the query, for example "
        f"layout={_SIZE},conf,class{instead}",
    )
