"""Layouts of tables of tracks: their columns, their class numbers, and how each is recognised.

A table without a header is compared with every layout of its number of columns. Exactly one has to
fit: if two fit, or none, the caller is asked (`?layout=`).
"""

from collections.abc import Callable
from dataclasses import dataclass

from surefoot.people import PEDESTRIANS, PersonClasses
from surefoot.tabular.facts import Facts

SIZE_FIRST = "frame,id,left,top,width,height"
CORNERS_FIRST = "frame,id,left,top,right,bottom"
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
        columns=_columns(f"{SIZE_FIRST},conf,-,-,-"),
        fewest=6,
        meaning="MOTChallenge results, without a class",
        fits=_mot,
    ),
    Layout(
        name="mot-gt",
        columns=_columns(f"{SIZE_FIRST},conf,class,visibility"),
        fewest=9,
        meaning="MOTChallenge ground truth: classes 1 and 7 are people, column 9 is the visibility",
        classes=_GROUND_TRUTH,
        fits=_ground_truth,
    ),
    Layout(
        name="cvat",
        columns=_columns(f"{SIZE_FIRST},conf,class,visibility"),
        fewest=9,
        meaning="a MOT export of CVAT: class numbers are the lines of its labels.txt, from 1",
        classes=None,
        fits=_cvat,
    ),
    Layout(
        name="boxmot",
        columns=_columns(f"{SIZE_FIRST},conf,class,-"),
        fewest=8,
        meaning="BoxMOT: column 7 is the confidence, class 0 is a person",
        fits=_boxmot,
    ),
    Layout(
        name="conf-last",
        columns=_columns(f"{SIZE_FIRST},-,class,conf"),
        fewest=9,
        meaning="column 9 is the confidence, class 0 is a person",
        fits=_conf_last,
    ),
    Layout(
        name="mcmot",
        columns=_columns(f"{SIZE_FIRST},conf,class,-,-"),
        fewest=10,
        meaning="MCMOT: class 0 is a person",
        fits=_mcmot,
    ),
    Layout(
        name="visdrone",
        columns=_columns(f"{SIZE_FIRST},conf,class,truncation,occlusion"),
        fewest=10,
        meaning="VisDrone: classes 1 (pedestrian) and 2 (people) are people",
        classes=_VISDRONE,
        fits=_visdrone,
    ),
    Layout(
        name="corners",
        columns=_columns(f"{CORNERS_FIRST},conf,class"),
        fewest=6,
        first=0,
        meaning="columns 5 and 6 are the right and bottom edge",
        fits=lambda facts: facts.corners >= 0.5,
    ),
    Layout(
        name="corners-size",
        columns=_columns(f"{CORNERS_FIRST},-,-"),
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
BY_NAME = {layout.name: layout for layout in LAYOUTS}
MOT, CORNERS = BY_NAME["mot"], BY_NAME["corners"]
# With frame, id and box first, so that the values of the other columns identify them.
IN_ORDER = tuple(layout for layout in LAYOUTS if layout.columns[:4] == MOT.columns[:4])


def in_usual_order(layout: Layout | None) -> bool:
    """True for a known layout with frame, id and box first; its values identify it."""
    return layout is None or layout in IN_ORDER
