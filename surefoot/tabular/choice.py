"""The layout of a table among the known ones: as named, by its values, or a question."""

from collections.abc import Sequence

from surefoot.tabular.columns import SIZE, UNUSED, form_of, role_of
from surefoot.tabular.facts import Facts
from surefoot.tabular.layouts import (
    BY_NAME,
    CORNERS,
    CORNERS_FIRST,
    IN_ORDER,
    LAYOUTS,
    MOT,
    SIZE_FIRST,
    Layout,
    LayoutError,
)


def read_layout(text: str) -> Layout:
    """Return the layout of a name, or of a list of columns such as `frame,id,x1,y1,x2,y2`.

    Raises:
        LayoutError: the name or a column is unknown, or the columns do not make a track.
    """
    if text in BY_NAME:
        return BY_NAME[text]
    names = [name.strip() for name in text.split(",")]
    if len(names) == 1:
        known = ", ".join(BY_NAME)
        needed = f"one of {known}, or a list of columns such as {CORNERS_FIRST},conf"
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
    return None if found is None else BY_NAME[found]


def by_content(facts: Facts, *, classes_given: bool) -> Layout:
    """Return the only layout that fits a table without a header.

    `classes_given`: the request names the classes of people, so there is a class column, and
    layouts that differ in class numbers only are the same.

    Raises:
        LayoutError: none fits, or several do.
    """
    fitting = [each for each in IN_ORDER if each is not CORNERS and each.fits(facts)]
    with_class = [layout for layout in fitting if "class" in layout.columns]
    if classes_given and with_class:
        fitting = with_class[:1]
    if not fitting:
        raise _unknown(facts)
    readings = [f"layout={layout.name} ({layout.meaning})" for layout in fitting]
    if facts.count in (7, 10) and facts.class_in_seventh and fitting == [MOT]:
        rest = ",-" * (facts.count - 7)
        readings = [
            f"layout={SIZE_FIRST},conf{rest} (column 7 is the confidence)",
            f"layout={SIZE_FIRST},class{rest} (column 7 is the class)",
        ]
    if facts.corners >= 0.9 and len(fitting) == 1 and fitting[0].columns[4] == "width":
        tail = "".join(f",{role}" for role in fitting[0].columns[6 : facts.count])
        corners = CORNERS.name if facts.count <= 7 else CORNERS_FIRST + tail
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
            f"list its columns instead, for example layout={SIZE_FIRST},conf",
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
        f"layout={SIZE_FIRST},conf,class{instead}",
    )
