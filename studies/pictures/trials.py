"""Trials of the turn: photographs turned by what is known, and pairs of one pose."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.pictures.features import Features, describe
from models.pictures.measures import Pixels
from models.pictures.turn import Turn, turn_between, turned_covariance, turned_pose
from models.pose import PictureEvidence, posterior_by_picture, turn_by_pose
from studies.pictures.weather import SIZE, drawn, fitted_to_view, lens, taken, turned

LARGEST_RAD = math.radians(25.0)
LENS_SD = 0.01  # of the focal length that is told: what a calibration is off by
SWAY_RAD = math.radians(0.02)  # sd of each angle: brackets in wind and sun
PRIOR = CameraPose.of_degrees(height_m=6.0, tilt_deg=20.0)
ENDINGS = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnTrial:
    """A known turn and what was said of it; None of what does not match.

    `error_rad` is the angle of the whole rotation by which it is off, `within` which of the three
    axes are within their 90 % interval, `off_sd` by how many standard deviations they are.
    """

    photograph: str
    turn_rad: float
    shared: float
    error_rad: float | None
    off_sd: tuple[float, ...]
    inliers: int
    shifted: bool


def photographs(folders: Sequence[Path]) -> dict[str, Pixels]:
    """All photographs of folders as pictures of the camera, by name."""
    found = {}
    for folder in folders:
        for path in sorted(folder.iterdir()):
            if path.suffix.lower() in ENDINGS:
                grey = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)
                found[path.stem] = fitted_to_view(grey)
    return found


def elsewhere(pictures: dict[str, Pixels], name: str) -> list[str]:
    """The photographs of other places: those whose names begin otherwise, in ten characters."""
    return [other for other in pictures if other[:10] != name[:10]]


def turn_trials(pictures: dict[str, Pixels], seeds: Sequence[int]) -> list[TurnTrial]:
    """A trial for each seed: a photograph, a turn of 0 to 25 deg, and weather before and after."""
    return [_turn_trial(pictures, seed) for seed in seeds]


def _turn_trial(pictures: dict[str, Pixels], seed: int) -> TurnTrial:
    draw = np.random.default_rng(seed)
    names = list(pictures)
    name = names[int(draw.integers(len(names)))]
    others = [pictures[other] for other in elsewhere(pictures, name)]
    vector = _turn(draw)
    matrix = cv2.Rodrigues(vector + draw.normal(0, SWAY_RAD, 3))[0]
    other = others[int(draw.integers(len(others)))]
    after = turned(pictures[name], other, np.asarray(matrix))
    told = lens(lens().fx * (1 + float(draw.normal(0, LENS_SD))))
    known = draw.random() < 0.5  # whether people's boxes are known
    features = []
    for picture in (pictures[name], after):
        sent, boxes = taken(picture, drawn(draw), others)
        features.append(describe(sent, boxes=boxes if known else None))
    found = turn_between(features[0], features[1], told)
    shared = shared_of(np.asarray(cv2.Rodrigues(vector)[0]))
    size = float(np.linalg.norm(vector))
    if found is None:
        return TurnTrial(
            photograph=name,
            turn_rad=size,
            shared=shared,
            error_rad=None,
            off_sd=(),
            inliers=0,
            shifted=False,
        )
    off = cv2.Rodrigues(found.matrix @ cv2.Rodrigues(vector)[0].T)[0].ravel()
    sds = np.sqrt(np.diag(found.covariance)[:3])
    return TurnTrial(
        photograph=name,
        turn_rad=size,
        shared=shared,
        error_rad=float(np.linalg.norm(off)),
        off_sd=tuple((off / sds).tolist()),
        inliers=found.inliers,
        shifted=found.shifted,
    )


def _turn(draw: np.random.Generator) -> Array:
    """A turn of 0 to 25 deg: mostly sideways and up or down, and some about the axis."""
    direction = draw.normal(0, (1.0, 1.0, 0.4))
    return np.asarray(direction / np.linalg.norm(direction) * draw.uniform(0, LARGEST_RAD))


def shared_of(rotation: Array) -> float:
    """The share of the old view that is in sight after a turn."""
    width, height = SIZE
    grid = np.stack(np.meshgrid(np.arange(0, width, 20), np.arange(0, height, 20)), axis=-1)
    rays, _ = lens().rays(grid.reshape(-1, 2).astype(np.float64))
    uv, valid = lens().project(rays @ rotation.T)
    return float((lens().contains(uv) & valid).mean())


@dataclass(frozen=True, slots=True, kw_only=True)
class PairTrial:
    """A pair of one pose, or of two scenes: how far it is said to have turned, and how likely."""

    pair: tuple[str, str]
    turn_rad: float
    moved: float
    inliers: int


def moved_by(turn: Turn, prior: CameraPose = PRIOR) -> float:
    """The probability that a camera moved, by one picture alone."""
    return posterior_by_picture(prior, evidence_of(turn, prior)).moved


def evidence_of(turn: Turn, prior: CameraPose = PRIOR) -> PictureEvidence:
    """The evidence of a turn on the camera's pose."""
    offset = turn_by_pose(prior, turned_pose(prior, turn))
    return PictureEvidence.of_match(offset, turned_covariance(prior, turn), turn.inliers)


def pair_trials(
    named: Sequence[tuple[str, Features]], pairs: Sequence[tuple[int, int]]
) -> list[PairTrial | None]:
    """A trial for each pair of pictures; None where it does not match."""
    found: list[PairTrial | None] = []
    for one, other in pairs:
        turn = turn_between(named[one][1], named[other][1], lens())
        if turn is None:
            found.append(None)
            continue
        found.append(
            PairTrial(
                pair=(named[one][0], named[other][0]),
                turn_rad=turn.angle_rad,
                moved=moved_by(turn),
                inliers=turn.inliers,
            )
        )
    return found


def still_pictures(
    pictures: dict[str, Pixels], name: str, count: int, seed: int
) -> list[tuple[str, Features]]:
    """Pictures of one pose in so many kinds of weather, half of them with boxes of people."""
    draw = np.random.default_rng(seed)
    others = [pictures[other] for other in elsewhere(pictures, name)]
    found = []
    for number in range(count):
        weather = drawn(draw, lorries=True)
        sent, boxes = taken(pictures[name], weather, others)
        known = boxes if draw.random() < 0.5 else None
        found.append((f"{name}#{number}", describe(sent, boxes=known)))
    return found
