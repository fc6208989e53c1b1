"""Tracks of people, read from the files that trackers write."""

import logging
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from models.errors import ShapeError
from models.geometry.rotation import Array
from models.tracks.trajectory import Trajectory, by_end
from surefoot.people import read_classes
from surefoot.tabular.layouts import LayoutError
from surefoot.tabular.reader import Options, TableTracks, read_table
from surefoot.track_rules import (
    TrackRejectedError,
    check_finite,
    check_order_and_length,
    check_upright,
    feet_of,
    refuse,
)

Track = Trajectory

log = logging.getLogger("surefoot.tracks")


class Tracks(list[Track]):
    """Tracks of a file in the order of their ends.

    `skipped` counts tracks that are not used by reason (`not_a_person`, `ignored_by_confidence`,
    `no_track_id`), `rejected` tracks that break a limit by code (`too_short`, ...). The service
    answers a post of the same file with the same counts.
    """

    def __init__(
        self, tracks: Iterable[Track], skipped: Mapping[str, int], rejected: Mapping[str, int]
    ) -> None:
        super().__init__(tracks)
        self.skipped = dict(skipped)
        self.rejected = dict(rejected)


def read_tracks(
    path: str | Path,
    *,
    frame_rate_hz: float | None = None,
    started_at_s: float = 0.0,
    layout: str | None = None,
    classes: str | None = None,
) -> Tracks:
    """Read the tracks of a text table: MOTChallenge text, its dialects, or CSV with a header.

    Args:
        path: of the file.
        frame_rate_hz: of a table with frame numbers.
        started_at_s: time of the first frame, seconds since the Unix epoch.
        layout: name of a layout (`mot`, `boxmot`, ...) or its columns, such as
            `frame,id,x1,y1,x2,y2`; needed if the table can be read in several ways.
        classes: class numbers or names of people, such as `1,7` or `person`.

    Raises:
        ShapeError: the file is missing, no line can be read, or the layout, the classes or the
            frame rate are not known.
    """
    try:
        body = Path(path).read_bytes()
        options = Options(
            frame_rate_hz=frame_rate_hz,
            started_at_s=started_at_s,
            layout=layout,
            classes=None if classes is None else read_classes(classes),
        )
        found = read_table(body, options)
    except LayoutError as error:
        where = f"{error.field}: " if error.field else ""
        raise ShapeError(f"{path}: {where}{error.reason}") from error
    except ValueError as error:
        raise ShapeError(f"{path}: classes: {error}") from error
    except OSError as error:
        raise ShapeError(f"{path}: {error.strerror or error}") from error
    tracks, rejected = [], Counter[str]()
    for name in found.rows:
        try:
            tracks.append(_track(found, name))
        except TrackRejectedError as error:
            rejected[error.code] += 1
    skipped = {str(reason): count for reason, count in found.skipped.items()}
    if skipped:
        classes_seen = ", ".join(found.other_classes) or "none"
        log.warning("%s: skipped tracks: %s; classes: %s", path, skipped, classes_seen)
    if rejected:
        log.info("%s: rejected tracks: %s", path, dict(rejected))
    return Tracks(by_end(tracks), skipped, rejected)


def _track(found: TableTracks, name: str) -> Track:
    """Return one track.

    Raises:
        TrackRejectedError: a line cannot be read, or a limit is broken.
    """
    if name in found.broken:
        refuse(found.broken[name])
    rows = found.rows[name]
    check_finite(rows)
    check_order_and_length(rows[:, 0])
    has_boxes = rows.shape[1] == 5
    if has_boxes:
        check_upright(rows[:, 1:])
    feet = feet_of(rows)
    top_v = _tops(rows) if has_boxes else None
    return Track(time_s=feet[:, 0].copy(), uv=feet[:, 1:].copy(), top_v=top_v)


def _tops(rows: Array) -> Array | None:
    """Return upper edges (N,), NaN where the image border may cut the box, or None if all are."""
    tops = np.where(rows[:, 2] > 1, rows[:, 2], np.nan)
    return tops if np.isfinite(tops).any() else None
