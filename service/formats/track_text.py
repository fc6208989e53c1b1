"""Tracks in text tables: MOTChallenge text, its dialects, and CSV with a header."""

from dataclasses import replace
from functools import partial

from service.errors import MalformedError, TooLargeError
from service.formats.batch import check_count, collect, malformed, reading
from service.formats.track import (
    MAX_TRACKS,
    Batch,
    Clock,
    IncomingTrack,
    Limits,
    check_track,
    track_name,
)
from surefoot.people import PersonClasses, read_classes
from surefoot.tabular.layouts import LayoutError
from surefoot.tabular.lines import Bounds, TooManyError
from surefoot.tabular.reader import Options, read_table
from surefoot.track_rules import refuse

MAX_LINES = 500_000  # some seconds of reading
_MOST_IDS = 4 * MAX_TRACKS  # those of cars among them


def read_text(
    body: bytes,
    source: str,
    clock: Clock,
    limits: Limits,
    *,
    layout: str | None = None,
    classes: PersonClasses | None = None,
) -> Batch:
    """Return the tracks of a text table, as `surefoot.tabular` reads it.

    A line that cannot be read costs its own track only; the index of a rejection is the place of
    its track by first appearance.

    Raises:
        MalformedError: the layout, the classes or the clock are not known, or no line is readable.
        TooLargeError: too many lines or tracks.
    """
    limits = limits.of_source(source)
    options = Options(
        frame_rate_hz=clock.frame_rate_hz,
        started_at_s=clock.started_at_s,
        layout=layout,
        classes=classes,
        normalised=limits.normalised,
        bounds=Bounds(lines=MAX_LINES, ids=_MOST_IDS, broken=MAX_TRACKS),
    )
    try:
        with reading():
            found = read_table(body, options)
    except TooManyError as error:
        raise TooLargeError(str(error)) from error
    except LayoutError as error:
        if not error.field:
            raise malformed(error.reason) from error
        raise MalformedError.of_field(error.field, error.reason) from error
    check_count(len(found.rows))
    limits = replace(limits, first_px=found.first_px)

    def read(track_id: str) -> IncomingTrack:
        if track_id in found.broken:
            refuse(found.broken[track_id])
        rows = limits.in_picture(found.rows[track_id])
        return check_track(track_name(track_id), source, rows, limits)

    items = (
        (index, {"id": track_id}, partial(read, track_id))
        for index, track_id in enumerate(found.rows)
    )
    batch = collect(source, items)
    return replace(batch, skipped=dict(found.skipped), other_classes=found.other_classes)


def people_classes(text: str) -> PersonClasses:
    """Return the classes of people of a query.

    Raises:
        MalformedError: the text is no list of numbers and names.
    """
    try:
        return read_classes(text)
    except ValueError as error:
        raise MalformedError.of_field("classes", str(error)) from error
