"""Tracks of people, read of the files that trackers write."""

import csv
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from models.errors import ShapeError
from models.tracks.trajectory import Trajectory, by_end

Track = Trajectory

_MOT_CELLS = 6  # frame, id, left, top, width, height; others are not looked at
_FOOT = ("track_id", "time_s", "u_px", "v_px")

# The track, the time in seconds, u and v of the foot, v of the head.
_Row = tuple[str, float, float, float, float]


def read_tracks(
    path: str | Path, *, frame_rate_hz: float | None = None, started_at_s: float = 0.0
) -> list[Track]:
    """The tracks of a file that are long enough to be taken, in the order of their ends.

    Two forms: MOTChallenge text, `frame,id,left,top,width,height,...` a line, frames and pixels
    counted from 1; and CSV with the columns track_id, time_s, u_px, v_px (the foot).

    Args:
        path: of the file.
        frame_rate_hz: of MOTChallenge text.
        started_at_s: the time of its first frame, seconds since the Unix epoch.

    Raises:
        ShapeError: the file is missing, is in neither form, or has no frame rate.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            first = file.readline()
            file.seek(0)
            has_names = set(_FOOT) <= set(first.strip().split(","))
            if not has_names and frame_rate_hz is None:
                raise ShapeError(f"{path}: frame_rate_hz is needed of MOTChallenge text")
            rows = list(_named(file) if has_names else _mot(file, frame_rate_hz or 1, started_at_s))
    except (OSError, TypeError, ValueError, IndexError) as error:
        raise ShapeError(f"{path}: neither MOTChallenge text nor CSV of feet: {error}") from error
    points: dict[str, dict[float, tuple[float, float, float]]] = defaultdict(dict)
    for name, time_s, *point in rows:
        points[name][time_s] = (point[0], point[1], point[2])
    tracks = (_track(each) for each in points.values())
    return by_end(track for track in tracks if track.long_enough)


def _named(lines: Iterator[str]) -> Iterator[_Row]:
    for row in csv.DictReader(lines):
        name, *numbers = (row[column] for column in _FOOT)
        time_s, u, v = map(float, numbers)
        yield name, time_s, u, v, np.nan


def _mot(lines: Iterator[str], frame_rate_hz: float, started_at_s: float) -> Iterator[_Row]:
    for line in lines:
        if not line.strip():
            continue
        cells = line.split(",")
        frame, _, left, top, width, height = map(float, cells[:_MOT_CELLS])
        time_s = started_at_s + (frame - 1) / frame_rate_hz
        top_v = top - 1 if top - 1 > 1 else np.nan  # cut by the border, as of `tops_of_boxes`
        yield cells[1].strip(), time_s, left - 1 + width / 2, top - 1 + height, top_v


def _track(points: dict[float, tuple[float, float, float]]) -> Track:
    rows = np.array([(time_s, *points[time_s]) for time_s in sorted(points)])
    tops = rows[:, 3]
    return Track(
        time_s=rows[:, 0], uv=rows[:, 1:3].copy(), top_v=tops if np.isfinite(tops).any() else None
    )
