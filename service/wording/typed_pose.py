"""Remarks on a pose that somebody typed, before it is trusted for months."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.geometry.ground import ground_from_pixel, ground_share, horizon_pixels, walking_speed
from models.geometry.intrinsics import Intrinsics
from models.geometry.lens_checks import LensDoubt, lens_questions
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.wording.language import N_, _

_USUAL_MPS = 1.35
_PLAUSIBLE_MPS = (0.95, 1.75)
_POSSIBLE_MPS = (0.7, 2.0)  # beyond, a reference is doubted, too
_LOW_M, _HIGH_M = 1.5, 60.0
_UNITS = {N_("centimetres"): 100.0, N_("millimetres"): 1000.0}  # that heights are read off plans in
_NARROW = math.radians(1)
_LEVEL = math.radians(45)
_OF_LENS = {
    LensDoubt.CORNER: N_(
        "The principal point ({cx:g}, {cy:g}) is at a corner of the image. Is the camera matrix "
        "transposed, as MATLAB writes it? There, cx and cy are in the third row."
    ),
    LensDoubt.OTHER_SIZE: N_(
        "The principal point ({cx:g}, {cy:g}) is the middle of an image of {width:.0f} x "
        "{height:.0f}. Was the lens calibrated at that size? Scale fx, fy, cx and cy to this one."
    ),
    LensDoubt.SWAPPED: N_(
        "The principal point ({cx:g}, {cy:g}) would be near the middle if width and height were "
        "swapped. Are they, or are cx and cy?"
    ),
    LensDoubt.OFF_CENTRE: N_(
        "The principal point ({cx:g}, {cy:g}) is far from the middle of the image. Was the lens "
        "calibrated at another image size, or is the stream cropped?"
    ),
    LensDoubt.ASPECT: N_(
        "fx / fy is {ratio:.2f}; most cameras have square pixels, for which it is 1. Was the lens "
        "calibrated at another image shape?"
    ),
    LensDoubt.FOLDS: N_(
        "The distortion folds back {px:.0f} px from the principal point. The {percent:.0f} % of "
        "the image beyond it has no viewing ray: people there are not mapped to the ground."
    ),
    LensDoubt.TANGENTIAL: N_(
        "p1 or p2 is {value:.2g}, unusually large. Is the order k1, k2, p1, p2, k3?"
    ),
}


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
        found.append(Saying(kind=Tone.INFO, text=_("R and t say: {pose}.", pose=pose_words(pose))))
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
    up_or_down = N_("looking down {deg:.1f}°") if tilt >= 0 else N_("looking up {deg:.1f}°")
    side = (
        N_("the left side {deg:.1f}° lower") if roll < 0 else N_("the right side {deg:.1f}° lower")
    )
    parts = [
        _("{m:.2f} m high", m=pose.height_m),
        _(up_or_down, deg=abs(tilt)),
        _(side, deg=abs(roll)),
        _("heading {deg:.1f}°", deg=math.degrees(pose.heading_rad) % 360),
    ]
    return ", ".join(parts)


def judge_tracks(
    lens: Intrinsics, pose: CameraPose, tracks: Sequence[Array], rate_hz: float
) -> list[Saying]:
    """Remarks on a pose and a frame rate by recorded tracks, each (N, 3) of frame, u and v."""
    floating = 0
    for track in tracks:
        hits = ground_from_pixel(lens, pose.rotation, pose.centre_m, track[:, 1:])[1]
        floating += bool(np.mean(hits) < 0.5)
    walks = [(track[:, 0] / rate_hz, track[:, 1:]) for track in tracks]
    speed = walking_speed(lens, pose, walks)
    found = []
    if floating:
        found.append(
            Saying(
                kind=Tone.CRITICAL if 2 * floating > len(tracks) else Tone.WARNING,
                text=_(
                    "{n} of {all} people walk in the sky: above the horizon, or too close to it. "
                    "The tilt, or its sign, is wrong.",
                    n=floating,
                    all=len(tracks),
                ),
            )
        )
    if math.isfinite(speed):
        found.append(_pace(speed, pose, rate_hz))
    elif not floating:
        found.append(
            Saying(kind=Tone.INFO, text=_("No track is long enough to tell how fast it is."))
        )
    return found


def _pace(speed: float, pose: CameraPose, rate_hz: float) -> Saying:
    if _PLAUSIBLE_MPS[0] <= speed <= _PLAUSIBLE_MPS[1]:
        text = _("People walk at {speed:.2f} m/s here: plausible.", speed=speed)
        return Saying(kind=Tone.GOOD, text=text)
    share = _USUAL_MPS / max(speed, 1e-3)
    mends = _(
        "At a usual {usual} m/s the camera would be {m:.1f} m high, or take {hz:.3g} frames a "
        "second.",
        usual=_USUAL_MPS,
        m=pose.height_m * share,
        hz=rate_hz * share,
    )
    slow = speed < _USUAL_MPS
    if _POSSIBLE_MPS[0] <= speed <= _POSSIBLE_MPS[1]:
        said = N_("People walk at {speed:.2f} m/s here, which is fast.")
        if slow:
            said = N_("People walk at {speed:.2f} m/s here, which is slow.")
        return Saying(kind=Tone.WARNING, text=f"{_(said, speed=speed)} {mends}")
    said = N_("People walk at {speed:.2f} m/s here: too fast.")
    if slow:
        said = N_("People walk at {speed:.2f} m/s here: too slow.")
    wrong = _("The height or the frame rate is wrong.")
    return Saying(kind=Tone.CRITICAL, text=f"{_(said, speed=speed)} {wrong} {mends}")


def _looking(lens: Intrinsics, pose: CameraPose, *, typed_angles: bool) -> list[Saying]:
    share, tilt_deg = ground_share(lens, pose), math.degrees(pose.tilt_rad)
    if tilt_deg < 0:
        if share == 0:
            ground = _(
                "The camera looks up by {deg:.1f}°, so there is no ground in the picture.",
                deg=-tilt_deg,
            )
        else:
            ground = _(
                "The camera looks up by {deg:.1f}°, so only {percent:.0f} % of the picture is "
                "ground.",
                deg=-tilt_deg,
                percent=100 * share,
            )
        how = _("Tilt is positive when the camera looks down: is its sign wrong?")
        if not typed_angles:
            how = _("Is R really camera from world, with Z up and the picture's y down?")
        return [
            Saying(
                kind=Tone.CRITICAL if share < 0.3 else Tone.WARNING,
                text=f"{ground} {how}",
                field="tilt_deg" if typed_angles else None,
                value=f"{-tilt_deg:g}" if typed_angles else None,
            )
        ]
    if share == 0:
        return [Saying(kind=Tone.CRITICAL, text=_("There is no ground in the picture."))]
    uv = horizon_pixels(lens, pose)[0]
    seen = uv[lens.contains(uv)]
    if len(seen):
        down = 100 * (float(np.median(seen[:, 1])) + 0.5) / lens.height
        where = _(
            "The horizon runs {percent:.0f} % down from the top of the picture.", percent=down
        )
    else:
        where = _("The horizon is above the picture: it shows ground only.")
    text = f"{where} {_('Compare it with what the camera shows.')}"
    return [Saying(kind=Tone.INFO, text=text)]


def _through(lens: Intrinsics) -> list[Saying]:
    asked = [
        Saying(kind=Tone.WARNING, text=_(_OF_LENS[each.doubt], **each.values), field=each.field)
        for each in lens_questions(lens)
    ]
    return [*_field_of_view(lens), *asked]


def _field_of_view(lens: Intrinsics) -> list[Saying]:
    if _NARROW <= lens.hfov_rad <= lens.widest_rad:
        return []
    said = _(
        "fx = {fx:g} pixels is a field of view of {deg:.1f}°.",
        fx=lens.fx,
        deg=math.degrees(lens.hfov_rad),
    )
    how = _("Are these millimetres? A lens may be told by them, with the sensor's size.")
    if lens.hfov_rad < _NARROW:
        how = _("Is the picture's width that of the lens' calibration?")
    return [Saying(kind=Tone.CRITICAL, text=f"{said} {how}", field="fx")]


def _standing(pose: CameraPose, *, typed_angles: bool) -> list[Saying]:
    found = []
    units = {name: pose.height_m / share for name, share in _UNITS.items()}
    meant = {name: value for name, value in units.items() if _LOW_M <= value <= _HIGH_M}
    if pose.height_m > _HIGH_M and meant:
        text = _(
            "The camera would be {m:,.0f} m high. Are these {units}?",
            m=pose.height_m,
            units=_(" or ").join(_(name) for name in meant),
        )
        found.append(
            Saying(
                kind=Tone.CRITICAL,
                text=text,
                field="height_m" if typed_angles else None,
                value=f"{next(iter(meant.values())):g}" if typed_angles else None,
            )
        )
    elif not _LOW_M <= pose.height_m <= _HIGH_M:
        text = _("{m:.2f} m is unusual for a camera's height.", m=pose.height_m)
        found.append(Saying(kind=Tone.WARNING, text=text))
    if abs(pose.roll_rad) > _LEVEL:
        text = _(
            "The camera is rolled by {deg:.0f}°: it lies on its side or hangs upside down. Is the "
            "picture turned, too?",
            deg=math.degrees(pose.roll_rad),
        )
        found.append(Saying(kind=Tone.WARNING, text=text))
    return found
