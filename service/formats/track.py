"""One incoming track: its value, its limits, and why it may be refused."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.tracks.scaling import Scaling
from service.formats.scaling import ImageSize, read_scaling
from surefoot.people import PEDESTRIANS, PersonClasses, SkipReason
from surefoot.times import LAST_S, not_seconds
from surefoot.track_rules import (
    TrackRejectedError,
    check_finite,
    check_order_and_length,
    check_upright,
    feet_of,
    refuse,
)

MAX_TRACKS = 5_000
MAX_ID_LENGTH = 200
# A foot may be below the picture; one a whole picture away from it is no foot.
MAX_OUTSIDE_IMAGES = 1.0
FOOT_COLUMNS = 3  # of a point: time, u and v; after them its head's, where it carries one


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
    """Tracks of a request.

    `skipped` counts tracks by reason; `other_classes` are the first classes that are no person.
    `ignored` names unknown fields.
    """

    source: str
    tracks: tuple[IncomingTrack, ...]
    rejections: tuple[Rejection, ...]
    skipped: dict[SkipReason, int] = field(default_factory=dict)
    other_classes: tuple[str, ...] = ()
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
    classes: PersonClasses = PEDESTRIANS

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


class TrackSkippedError(Exception):
    """A track that is left out without being an error of its sender; `label` is its class."""

    def __init__(self, reason: SkipReason, label: object) -> None:
        super().__init__(reason)
        self.reason = reason
        self.label = label


def check_heads(rows: Array, size: tuple[int, int]) -> None:
    """Refuse heads of rows (N, 5), time, u, v, u and v of the head, that nobody carries.

    Raises:
        TrackRejectedError: a head that is not finite, not above its foot, or far outside.
    """
    check_finite(rows)
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
    check_finite(rows)
    _check_times(rows[:, 0], limits)
    check_order_and_length(rows[:, 0])
    boxes = None if rows.shape[1] == FOOT_COLUMNS else rows[:, 1:]
    if boxes is not None:
        check_upright(boxes)
    points = feet_of(rows)
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


def _check_times(time_s: Array, limits: Limits) -> None:
    in_range = (time_s >= 0) & (time_s <= limits.now_s + limits.max_ahead_s)
    if in_range.all():
        return
    at = int(np.argmin(in_range))
    got = float(time_s[at])
    if got > LAST_S:
        raise TrackRejectedError("time_out_of_range", f"points/{at}/0: {not_seconds(got)}")
    needed = "seconds from 1970 on are needed"
    if got > 0:
        needed = (
            f"at most {limits.max_ahead_s:g} s ahead of this service's clock, "
            f"{limits.now_s:.3f}, are taken; this is {got - limits.now_s:.3f} s ahead: "
            "one of the two clocks, or a zone, is wrong"
        )
    raise TrackRejectedError("time_out_of_range", f"points/{at}/0: {needed}, got {got:.3f}")


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
