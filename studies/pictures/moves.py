"""Small turns of a real camera: images of other hours, turned by a known angle, one and three.

The noise is real: a reference and later images of the same camera, hours and weeks apart. Images
of the same light, images across a change of light (brought back by the turn that all of them
together measure), and simulated light on an image of the same moment.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from models.assessment import judge
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import ANGLES, CameraPose
from models.geometry.rotation import Array
from models.monitoring.drift import DriftLimits
from models.pictures.features import Features, describe
from models.pictures.measures import Pixels
from models.pictures.turn import Turn, turn_between
from models.pose import PictureEvidence, drift_by_images, of_agreeing, posterior_by_picture
from studies.pictures.trials import PRIOR, evidence_of
from studies.pictures.weather import drawn, lens, taken

SIZES_DEG = (0.5, 1.0, 1.3, 2.0, 3.0, 5.0)
TURNS = tuple((size, angles) for size in SIZES_DEG for angles in (1, 2, 3))
NO_TURN = (0.0, 0)
_STILL = 6  # trials of a camera that did not move, in each round
_SHIFT_PX = 0.2  # of a simulated image: a lens that warms up
_IMAGES = 3


class Light(StrEnum):
    """The light between a reference and the images that are compared with it."""

    SAME = "other hours"
    OTHER = "another season"
    SIMULATED = "simulated"


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveTrial:
    """A known turn in one to three angles of the pose, by three images; 0 deg if it did not move.

    `one` and `three` are the probabilities of a move by the first image and by all of them.
    `one_alerts` and `three_alert` are the alerts by the first and by all. `inliers` are of the
    first; 0 if it did not match, and then it is no evidence.
    """

    light: str
    size_deg: float
    angles: int
    inliers: int
    one: float
    three: float
    one_alerts: bool
    three_alert: bool


def move_trials(
    before: Sequence[Path], after: Sequence[Path], focal_px: float, number: int
) -> list[MoveTrial]:
    """One trial for each light, size and count of angles; `number` is the seed."""
    cv2.setNumThreads(1)
    draw = np.random.default_rng(number)
    own, clips = lens(focal_px), _clips(after)
    found = []
    for light in Light:
        for size, angles in (*TURNS, *[NO_TURN] * _STILL):
            order = [list(clips)[k] for k in draw.permutation(len(clips))]
            paths = [clips[name][int(draw.integers(len(clips[name])))] for name in order]
            reference, seen = paths[0], paths[1 : 1 + _IMAGES]
            if light == Light.OTHER:
                reference = before[int(draw.integers(len(before)))]
            elif light == Light.SIMULATED:
                seen = [reference] * _IMAGES
            turn = known_turn(size, angles, draw)
            images = [_seen(reference, path, turn, light, own, draw) for path in seen]
            turns = [turn_between(_features(reference), image, own) for image in images]
            found.append(_trial(light, size, angles, turns))
    return found


def known_turn(size_deg: float, angles: int, draw: np.random.Generator) -> Array:
    """A rotation (3, 3) of the camera by so much, equally in some of tilt, roll and heading."""
    if not angles:
        return np.eye(3)
    chosen = draw.permutation(len(ANGLES))[:angles]
    shares = {f"{ANGLES[k]}_rad": float(draw.choice([-1.0, 1.0])) for k in chosen}

    def after(by_rad: float) -> Array:
        pose = replace(
            PRIOR, **{name: getattr(PRIOR, name) + by_rad * sign for name, sign in shares.items()}
        )
        return np.asarray(pose.rotation @ PRIOR.rotation.T)

    unit = math.radians(0.1)
    whole = float(np.linalg.norm(cv2.Rodrigues(after(unit))[0]))
    return after(unit * math.radians(size_deg) / whole)


def _trial(light: Light, size: float, angles: int, turns: Sequence[Turn | None]) -> MoveTrial:
    by_image = [None if turn is None else evidence_of(turn) for turn in turns]
    matched = [each for each in by_image if each is not None]
    one, one_alerts = _judged(by_image[:1] if by_image[0] is not None else [])
    three, three_alert = _judged(matched)
    return MoveTrial(
        light=light.value,
        size_deg=size,
        angles=angles,
        inliers=0 if turns[0] is None else turns[0].inliers,
        one=one,
        three=three,
        one_alerts=one_alerts,
        three_alert=three_alert,
    )


def _judged(
    images: Sequence[PictureEvidence | None], prior: CameraPose = PRIOR
) -> tuple[float, bool]:
    """The probability of a move by images, and whether it is an alert with the usual limits."""
    known = [each for each in images if each is not None]
    if not known:
        return 0.0, False
    posterior = posterior_by_picture(prior, of_agreeing(known))
    verdict = judge(drift_by_images(posterior), DriftLimits(), ())
    return posterior.moved, verdict.drifting


def _seen(
    reference: Path,
    path: Path,
    turn: Array,
    light: Light,
    own: Intrinsics,
    draw: np.random.Generator,
) -> Features:
    """Features of an image as it would be after a turn of the camera of the reference."""
    grey = _grey(path)
    back = _apart(reference, path, own).T
    if light == Light.SIMULATED:
        grey, _ = taken(_shifted(grey), drawn(draw), [_grey(path)])
    matrix = own.matrix
    warp = matrix @ turn @ back @ np.linalg.inv(matrix)
    size = (own.width, own.height)
    turned = cv2.warpPerspective(grey, warp, size, flags=cv2.INTER_CUBIC)
    return describe(np.asarray(turned, np.uint8))


def _shifted(grey: Pixels) -> Pixels:
    by = np.array([[1, 0, _SHIFT_PX], [0, 1, _SHIFT_PX]])
    shifted = cv2.warpAffine(
        grey, by, grey.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(shifted, np.uint8)


@lru_cache(maxsize=512)
def _apart(reference: Path, path: Path, own: Intrinsics) -> Array:
    """The rotation (3, 3) between two images of the real camera, by all images of its folder.

    Across a change of light one comparison is less sure than the turns to look for, so the mean
    over all later images is taken, each brought to `path` by what it has turned since.
    """
    if reference == path:
        return np.eye(3)
    direct = turn_between(_features(reference), _features(path), own)
    assert direct is not None, f"{path.name} does not match {reference.name}"
    if direct.inliers >= 150:
        return direct.matrix
    vectors, precisions = [], []
    for other in sorted(path.parent.glob("*.jpg")):
        first = turn_between(_features(reference), _features(other), own)
        since = turn_between(_features(other), _features(path), own)
        if first is None or since is None or since.inliers < 150:
            continue
        vectors.append(cv2.Rodrigues(since.matrix @ first.matrix)[0].ravel())
        precisions.append(np.linalg.inv(first.covariance[:3, :3] + since.covariance[:3, :3]))
    pulls = [p @ v for p, v in zip(precisions, vectors, strict=True)]
    return np.asarray(cv2.Rodrigues(np.linalg.solve(sum(precisions), sum(pulls)))[0])


@lru_cache(maxsize=64)
def _features(path: Path) -> Features:
    return describe(_grey(path))


@lru_cache(maxsize=64)
def _grey(path: Path) -> Pixels:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)


def _clips(paths: Sequence[Path]) -> dict[str, list[Path]]:
    """Images by their clip: those of one clip are seconds apart."""
    found: dict[str, list[Path]] = {}
    for path in paths:
        found.setdefault(path.stem.rpartition("_")[0], []).append(path)
    return found
