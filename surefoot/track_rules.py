"""Limits of one track that do not depend on a camera, for every source of tracks."""

from typing import NoReturn

import numpy as np

from models.geometry.rotation import Array
from models.tracks.trajectory import TRACK_MIN_DURATION_S, TRACK_MIN_POINTS

MAX_POINTS = 10_000
# The longest recorded tracks last 46 minutes, with gaps of 3 s: a track that is longer, or that
# continues after ten minutes, is of several people.
MAX_DURATION_S, MAX_GAP_S = 3_600.0, 600.0


class TrackRejectedError(Exception):
    """A track that breaks a limit; the other tracks of its request are not concerned."""

    def __init__(self, code: str, detail: str) -> None:
        super().__init__(detail)
        self.code = code
        self.detail = detail


def refuse(detail: str) -> NoReturn:
    """Reject a track that cannot be read.

    Raises:
        TrackRejectedError: always.
    """
    raise TrackRejectedError("malformed", detail)


def check_finite(rows: Array) -> None:
    """Check that there are not too many rows, and that all numbers are finite.

    Raises:
        TrackRejectedError: with the row and the value.
    """
    if len(rows) > MAX_POINTS:
        raise TrackRejectedError(
            "too_many_points", f"points: at most {MAX_POINTS} a track are taken, got {len(rows)}"
        )
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        at = int(np.argmin(finite))
        raise TrackRejectedError(
            "not_finite", f"points/{at}: finite numbers are needed, got {rows[at].tolist()}"
        )


def check_order_and_length(time_s: Array) -> None:
    """Check that times increase, and that a track is neither too short nor too long.

    Raises:
        TrackRejectedError: with the limit and the value.
    """
    increasing = np.diff(time_s) > 0
    if not increasing.all():
        at = int(np.argmin(increasing)) + 1
        raise TrackRejectedError(
            "time_not_increasing",
            f"points/{at}/0: must be later than the point before, {time_s[at - 1]:.3f}, "
            f"got {time_s[at]:.3f}",
        )
    duration_s = float(time_s[-1] - time_s[0]) if len(time_s) else 0.0
    if len(time_s) < TRACK_MIN_POINTS or duration_s < TRACK_MIN_DURATION_S - 1e-6:
        raise TrackRejectedError(
            "too_short",
            f"{len(time_s)} points over {duration_s:.1f} s; at least {TRACK_MIN_POINTS} points "
            f"over {TRACK_MIN_DURATION_S:g} s are needed",
        )
    if duration_s > MAX_DURATION_S:
        raise TrackRejectedError(
            "too_long",
            f"points: at most {MAX_DURATION_S:g} s a track are taken, got {duration_s:.1f} s: "
            "the clock or frame_rate_hz is wrong, or a track of several people is to be cut",
        )
    gap_s = np.diff(time_s)
    if gap_s.max() > MAX_GAP_S:
        at = int(np.argmax(gap_s)) + 1
        raise TrackRejectedError(
            "gap",
            f"points/{at}/0: at most {MAX_GAP_S:g} s after the point before are taken, got "
            f"{gap_s[at - 1]:.1f} s: what comes after such a gap is a track of its own",
        )


def check_upright(boxes: Array) -> None:
    """Check that boxes x1, y1, x2, y2 (N, 4) have a width and a height.

    Raises:
        TrackRejectedError: with the box.
    """
    upright = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])
    if not upright.all():
        at = int(np.argmin(upright))
        refuse(f"boxes/{at}: x1 < x2 and y1 < y2 are needed, got {boxes[at].tolist()}")


def feet_of(rows: Array) -> Array:
    """Return time, u, v (N, 3) of rows that are so, or that are time and box (N, 5)."""
    if rows.shape[1] == 3:
        return rows
    return np.column_stack([rows[:, 0], (rows[:, 1] + rows[:, 3]) / 2, rows[:, 4]])
