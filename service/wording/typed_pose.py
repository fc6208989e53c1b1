"""Remarks on a pose that somebody typed, before it is trusted for months."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.geometry.ground import ground_from_pixel, ground_share, horizon_pixels, walking_speed
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array

_USUAL_MPS = 1.35
_PLAUSIBLE_MPS = (0.95, 1.75)
_POSSIBLE_MPS = (0.7, 2.0)  # beyond, a reference is doubted, too
_LOW_M, _HIGH_M = 1.5, 60.0
_UNITS = {"centimetres": 100.0, "millimetres": 1000.0}  # that heights are read off plans in
_NARROW = math.radians(1)
_LEVEL = math.radians(45)


class Tone(StrEnum):
    """Tones of remarks, those first that somebody has to look at."""

    CRITICAL = "critical"
    WARNING = "warning"
    GOOD = "good"
    INFO = "info"


@dataclass(frozen=True, slots=True, kw_only=True)
class Saying:
    """Something about a pose; `field` and `value` may mend it."""

    kind: Tone
    text: str
    field: str | None = None
    value: str | None = None


def judge_pose(lens: Intrinsics, pose: CameraPose, *, typed_angles: bool) -> list[Saying]:
    """Remarks on a pose."""
    found = [
        *_through(lens),
        *_looking(lens, pose, typed_angles=typed_angles),
        *_standing(pose, typed_angles=typed_angles),
    ]
    if not typed_angles:
        found.append(Saying(kind=Tone.INFO, text=f"R and t say: {pose_words(pose)}."))
    return found


def judge_typed(lens: Intrinsics, pose: CameraPose) -> list[Saying]:
    """What may be a slip of the pen in a lens and a pose: remarks that ask for a second look."""
    says = judge_pose(lens, pose, typed_angles=True)
    return [each for each in says if each.kind in (Tone.CRITICAL, Tone.WARNING)]


def worst_first(sayings: Sequence[Saying]) -> list[Saying]:
    """Remarks in order: those first that somebody has to look at, then what is good to know."""
    order = list(Tone)
    return sorted(sayings, key=lambda saying: order.index(saying.kind))


def pose_words(pose: CameraPose) -> str:
    """A pose in words: "7.84 m high, looking down 20.0°, ..."."""
    tilt, roll = math.degrees(pose.tilt_rad), math.degrees(pose.roll_rad)
    parts = [
        f"{pose.height_m:.2f} m high",
        f"looking {'down' if tilt >= 0 else 'up'} {abs(tilt):.1f}°",
        f"the {'right' if roll >= 0 else 'left'} side {abs(roll):.1f}° lower",
        f"heading {math.degrees(pose.heading_rad) % 360:.1f}°",
    ]
    return ", ".join(parts)


def judge_tracks(
    lens: Intrinsics, pose: CameraPose, tracks: Sequence[Array], rate_hz: float
) -> list[Saying]:
    """Remarks on a pose and a frame rate by recorded tracks, each (N, 3) of frame, u and v."""
    floating = 0
    for track in tracks:
        _, hits = ground_from_pixel(lens, pose.rotation, pose.centre_m, track[:, 1:])
        floating += bool(np.mean(hits) < 0.5)
    walks = [(track[:, 0] / rate_hz, track[:, 1:]) for track in tracks]
    speed = walking_speed(lens, pose, walks)
    found = []
    if floating:
        found.append(
            Saying(
                kind=Tone.CRITICAL if 2 * floating > len(tracks) else Tone.WARNING,
                text=f"{floating} of {len(tracks)} people walk in the sky: above the horizon, or "
                "too close to it. The tilt, or its sign, is wrong.",
            )
        )
    if math.isfinite(speed):
        found.append(_pace(speed, pose, rate_hz))
    elif not floating:
        found.append(Saying(kind=Tone.INFO, text="No track is long enough to tell how fast it is."))
    return found


def _pace(speed: float, pose: CameraPose, rate_hz: float) -> Saying:
    said = f"People walk at {speed:.2f} m/s here"
    if _PLAUSIBLE_MPS[0] <= speed <= _PLAUSIBLE_MPS[1]:
        return Saying(kind=Tone.GOOD, text=f"{said}: plausible.")
    share = _USUAL_MPS / max(speed, 1e-3)
    mends = (
        f"At a usual {_USUAL_MPS} m/s the camera would be {pose.height_m * share:.1f} m high, or "
        f"take {rate_hz * share:.3g} frames a second."
    )
    pace = "slow" if speed < _USUAL_MPS else "fast"
    if _POSSIBLE_MPS[0] <= speed <= _POSSIBLE_MPS[1]:
        return Saying(kind=Tone.WARNING, text=f"{said}, which is {pace}. {mends}")
    return Saying(
        kind=Tone.CRITICAL,
        text=f"{said}: too {pace}. The height or the frame rate is wrong. {mends}",
    )


def _looking(lens: Intrinsics, pose: CameraPose, *, typed_angles: bool) -> list[Saying]:
    share, tilt_deg = ground_share(lens, pose), math.degrees(pose.tilt_rad)
    if tilt_deg < 0:
        ground = "there is no ground in the picture" if share == 0 else (
            f"only {100 * share:.0f} % of the picture is ground"
        )  # fmt: skip
        how = "Tilt is positive when the camera looks down: is its sign wrong?"
        if not typed_angles:
            how = "Is R really camera from world, with Z up and the picture's y down?"
        return [
            Saying(
                kind=Tone.CRITICAL if share < 0.3 else Tone.WARNING,
                text=f"The camera looks up by {-tilt_deg:.1f}°, so {ground}. {how}",
                field="tilt_deg" if typed_angles else None,
                value=f"{-tilt_deg:g}" if typed_angles else None,
            )
        ]
    if share == 0:
        return [Saying(kind=Tone.CRITICAL, text="There is no ground in the picture.")]
    uv, _ = horizon_pixels(lens, pose)
    seen = uv[lens.contains(uv)]
    if len(seen):
        down = 100 * (float(np.median(seen[:, 1])) + 0.5) / lens.height
        where = f"The horizon runs {down:.0f} % down from the top of the picture"
    else:
        where = "The horizon is above the picture: it shows ground only"
    return [Saying(kind=Tone.INFO, text=f"{where}. Compare it with what the camera shows.")]


def _through(lens: Intrinsics) -> list[Saying]:
    if _NARROW <= lens.hfov_rad <= lens.widest_rad:
        return []
    said = f"fx = {lens.fx:g} pixels is a field of view of {math.degrees(lens.hfov_rad):.1f}°"
    how = "Are these millimetres? A lens may be told by them, with the sensor's size."
    if lens.hfov_rad < _NARROW:
        how = "Is the picture's width that of the lens' calibration?"
    return [Saying(kind=Tone.CRITICAL, text=f"{said}. {how}", field="fx")]


def _standing(pose: CameraPose, *, typed_angles: bool) -> list[Saying]:
    found = []
    units = {name: pose.height_m / share for name, share in _UNITS.items()}
    meant = {name: value for name, value in units.items() if _LOW_M <= value <= _HIGH_M}
    if pose.height_m > _HIGH_M and meant:
        found.append(
            Saying(
                kind=Tone.CRITICAL,
                text=f"The camera would be {pose.height_m:,.0f} m high. "
                f"Are these {' or '.join(meant)}?",
                field="height_m" if typed_angles else None,
                value=f"{next(iter(meant.values())):g}" if typed_angles else None,
            )
        )
    elif not _LOW_M <= pose.height_m <= _HIGH_M:
        found.append(
            Saying(
                kind=Tone.WARNING, text=f"{pose.height_m:.2f} m is unusual for a camera's height."
            )
        )
    if abs(pose.roll_rad) > _LEVEL:
        found.append(
            Saying(
                kind=Tone.WARNING,
                text=f"The camera is rolled by {math.degrees(pose.roll_rad):.0f}°: it lies on its "
                "side or hangs upside down. Is the picture turned, too?",
            )
        )
    return found
