"""One incoming track: its value, its limits, and why it may be refused."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.tracks.scaling import Scaling
from models.tracks.trajectory import TRACK_MIN_DURATION_S, TRACK_MIN_POINTS
from service.formats.scaling import ImageSize, read_scaling

# Of detectors trained on COCO, BoxMOT's among them.
COCO_PEOPLE = frozenset((0.0,))
MAX_POINTS = 10_000
MAX_TRACKS = 5_000
MAX_ID_LENGTH = 200
# Nobody takes an hour to walk through a picture, or is the same person to a tracker that has not
# seen them for ten minutes: the longest of our recordings are 46 minutes and 3 s.
MAX_DURATION_S, MAX_GAP_S = 3_600.0, 600.0
# A foot may be below the picture; one a whole picture away from it is no foot.
MAX_OUTSIDE_IMAGES = 1.0
FOOT_COLUMNS = 3  # of a point: time, u and v; after them its head's, where it carries one
_YEAR_9999_S = 253_402_300_799.0


@dataclass(frozen=True, slots=True, kw_only=True)
class IncomingTrack:
    """A track as posted: points (N, 3) are time in s, u and v; boxes (N, 4) x1, y1, x2, y2.

    Heads (N, 2) are u and v, where points carry them. `first_px` is the number of the first pixel
    in the post; None if the post states the image size of its numbers.
    """

    source: str
    track_id: str
    points: Array
    boxes: Array | None = None
    heads: Array | None = None
    first_px: int | None = None

    @property
    def stored_bytes(self) -> int:
        """Size in the store."""
        arrays = (self.points, self.boxes, self.heads)
        return sum(array.nbytes for array in arrays if array is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejection:
    """The reason why one track of a request is not stored; `index` is its place in the request."""

    index: int
    track_id: str | None
    code: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Tracks as read of a request; `left_out` lines or tracks of it were of no person.

    `ignored` names fields of it that nobody knows here.
    """

    tracks: tuple[IncomingTrack, ...]
    rejections: tuple[Rejection, ...]
    left_out: int = 0
    ignored: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Clock:
    """Conversion of frame numbers to times; unset where the request does not say."""

    frame_rate_hz: float | None
    started_at_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of tracks: the picture, and the time by our clock; how their numbers come into it.

    A track of later than now owns the camera's window, which is of the newest tracks, until that
    time comes: `max_ahead_s` is what clocks may differ by. `image_sizes` are declared for sources
    whose posts do not state one (`stated`). `first_px` is the number of the first pixel.
    """

    width: int
    height: int
    now_s: float
    max_ahead_s: float
    scaling: Scaling | None = None
    stated: bool = False
    first_px: int = 0
    image_sizes: Mapping[str, ImageSize] = field(default_factory=dict)
    fisheye: Intrinsics | None = None  # the lens, where it has no picture of some pixels

    def of_size(self, size: Any, normalised: Any) -> "Limits":
        """The limits of numbers of a picture as a request names it; the same where it does not.

        Raises:
            ValueError: with the field, what is needed and what came.
        """
        if size is None and normalised is None:
            return self
        scaling = read_scaling(size, normalised, (self.width, self.height))
        return replace(self, scaling=scaling, stated=True)

    def of_source(self, source: str) -> "Limits":
        """The limits of numbers by a source: of its declared image size, unless one is stated."""
        declared = self.image_sizes.get(source)
        if self.stated or declared is None:
            return self
        return replace(self, scaling=declared.scaling((self.width, self.height)))

    @property
    def normalised(self) -> bool:
        """True where numbers are shares of a picture."""
        return self.scaling is not None and self.scaling.normalised

    def in_picture(self, rows: Array) -> Array:
        """Rows (N, 3) or (N, 5) of time, u, v, u, v as given, in pixels of the frame."""
        if self.scaling is None:
            return rows
        scaled = rows.copy()
        with np.errstate(over="ignore", invalid="ignore"):  # rejected by name later
            scaled[:, 1:] = self.scaling.applied(rows[:, 1:])
        return scaled


class NoPersonError(Exception):
    """A track is of something that does not walk, as its class says."""


class TrackRejectedError(Exception):
    """One track breaks a limit; the others of its request do not suffer."""

    def __init__(self, code: str, detail: str) -> None:
        super().__init__(detail)
        self.code = code
        self.detail = detail


def refuse(detail: str) -> NoReturn:
    """Refuse a track that cannot be read.

    Raises:
        TrackRejectedError: always.
    """
    raise TrackRejectedError("malformed", detail)


def check_heads(rows: Array, size: tuple[int, int]) -> None:
    """Refuse heads of rows (N, 5), time, u, v, u and v of the head, that nobody carries.

    Raises:
        TrackRejectedError: a head that is not finite, not above its foot, or far outside.
    """
    _check_finite(rows)
    above = rows[:, 4] < rows[:, 2]
    if not above.all():
        at = int(np.argmin(above))
        refuse(
            f"points/{at}/4: a head above its foot, v_head below {rows[at, 2]:g}, is needed, "
            f"got {rows[at, 4]:g}",
        )
    _check_inside(rows[:, FOOT_COLUMNS:], size, "heads of points")


def check_track(track_id: str, source: str, rows: Array, limits: Limits) -> IncomingTrack:
    """The track of rows (N, 3) of time, u, v or (N, 5) of time and box, if it keeps the limits.

    Raises:
        TrackRejectedError: with a code, the field, the limit and the value received.
    """
    if len(rows) > MAX_POINTS:
        raise TrackRejectedError(
            "too_many_points", f"points: at most {MAX_POINTS} a track are taken, got {len(rows)}"
        )
    _check_finite(rows)
    time_s = rows[:, 0]
    _check_times(time_s, limits)
    increasing = np.diff(time_s) > 0
    if not increasing.all():
        at = int(np.argmin(increasing)) + 1
        raise TrackRejectedError(
            "time_not_increasing",
            f"points/{at}/0: must be later than the point before, {time_s[at - 1]:.3f}, "
            f"got {time_s[at]:.3f}",
        )
    duration_s = float(time_s[-1] - time_s[0]) if len(rows) else 0.0
    if len(rows) < TRACK_MIN_POINTS or duration_s < TRACK_MIN_DURATION_S - 1e-6:
        raise TrackRejectedError(
            "too_short",
            f"{len(rows)} points over {duration_s:.1f} s; at least {TRACK_MIN_POINTS} points "
            f"over {TRACK_MIN_DURATION_S:g} s are needed",
        )
    _check_lengths(time_s)
    boxes = None
    points = rows
    if rows.shape[1] == 5:
        boxes = rows[:, 1:]
        upright = (boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])
        if not upright.all():
            at = int(np.argmin(upright))
            refuse(f"boxes/{at}: x1 < x2 and y1 < y2 are needed, got {boxes[at].tolist()}")
        points = np.column_stack([time_s, (boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]])
    _check_inside(points[:, 1:], (limits.width, limits.height))
    if limits.fisheye is not None:
        _check_seen(points[:, 1:], limits.fisheye)
    return IncomingTrack(
        source=source,
        track_id=track_id,
        points=points,
        boxes=boxes,
        first_px=None if limits.stated else limits.first_px,
    )


def track_name(value: Any) -> str:
    """The tracker's id of a track, as text.

    Raises:
        TrackRejectedError: missing, neither text nor a whole number, empty or too long.
    """
    if isinstance(value, bool) or not isinstance(value, str | int):
        refuse(f"id: text or a whole number is needed, got {value!r:.60}")
    name = str(value)
    if not 1 <= len(name) <= MAX_ID_LENGTH:
        refuse(f"id: 1 to {MAX_ID_LENGTH} characters are needed, got {len(name)}")
    if not is_text(name):
        refuse("id: text without NUL or half a surrogate pair is needed")
    return name


def is_text(value: str) -> bool:
    """True of text that can be stored and sent; JSON's escapes allow half a surrogate pair."""
    try:
        return "\0" not in value and bool(value.encode())
    except UnicodeEncodeError:
        return False


def _check_finite(rows: Array) -> None:
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        at = int(np.argmin(finite))
        raise TrackRejectedError(
            "not_finite", f"points/{at}: finite numbers are needed, got {rows[at].tolist()}"
        )


def _check_times(time_s: Array, limits: Limits) -> None:
    in_range = (time_s >= 0) & (time_s <= limits.now_s + limits.max_ahead_s)
    if in_range.all():
        return
    at = int(np.argmin(in_range))
    got = float(time_s[at])
    needed = "seconds from 1970 on are needed"
    if got > _YEAR_9999_S:
        needed += "; these look like milliseconds"
    elif got > 0:
        needed = (
            f"at most {limits.max_ahead_s:g} s ahead of this service's clock, "
            f"{limits.now_s:.3f}, are taken; this is {got - limits.now_s:.3f} s ahead: "
            "one of the two clocks, or a zone, is wrong"
        )
    raise TrackRejectedError("time_out_of_range", f"points/{at}/0: {needed}, got {got:.3f}")


def _check_lengths(time_s: Array) -> None:
    """Refuse times that a wrong clock or frame rate makes, and nobody's walk."""
    duration_s = float(time_s[-1] - time_s[0])
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


def _check_inside(uv: Array, size: tuple[int, int], what: str = "points") -> None:
    limit = np.array(size) * MAX_OUTSIDE_IMAGES
    inside = ((uv >= -limit) & (uv <= np.array(size) + limit)).all(axis=1)
    if not inside.all():
        at = int(np.argmin(inside))
        raise TrackRejectedError(
            "outside_image",
            f"{what}/{at}: u from {-limit[0]:.0f} to {size[0] + limit[0]:.0f} and v from "
            f"{-limit[1]:.0f} to {size[1] + limit[1]:.0f} px are taken, got "
            f"({uv[at, 0]:.1f}, {uv[at, 1]:.1f})",
        )


def _check_seen(uv: Array, lens: Intrinsics) -> None:
    beyond = lens.beyond(uv)
    if beyond.any():
        at = int(np.argmax(beyond))
        raise TrackRejectedError(
            "outside_lens",
            f"points/{at}: {lens.beyond_words}, got ({uv[at, 0]:.1f}, {uv[at, 1]:.1f})",
        )
