"""The turn of a camera between two of its pictures, with its covariance, and the pose after it."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, pose_from_centre
from models.geometry.rotation import Array, Mask, angles_from_rotation
from models.pictures import config
from models.pictures.consensus import (
    Consensus,
    biweights,
    consensus_at,
    derivatives_px,
    find,
    fitted,
    normal_of,
    residuals_px,
)
from models.pictures.features import Features
from models.pictures.matching import Matches, lens_of, match

_REFITS = 10
_STEP_RAD = 1e-6  # of numeric derivatives
_FACE = 24  # directions across the picture, for what is still in sight


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A camera's turn since a reference picture.

    `rotation` (3,) is the rotation vector in radians of `now_from_reference`, in OpenCV's camera
    frame: x right, y down, z forward, so that a ray x of before is seen at R x. `log_zoom` is the
    log of the focal length now by that before. `covariance` (4, 4) is of a small turn on the left
    of R and of the log zoom; floors for light, sway and the lens are in it.

    `inliers` of `matches` agree, `shared` is the share of the old view that is still in sight.
    `shifted` says that the camera moved aside in a scene of some depth, more likely than that it
    only turned: then the covariance is wider.
    """

    rotation: Array
    log_zoom: float
    covariance: Array
    inliers: int
    matches: int
    shared: float
    shifted: bool

    @property
    def matrix(self) -> Array:
        """R (3, 3) of `now_from_reference`."""
        return np.asarray(cv2.Rodrigues(np.asarray(self.rotation, np.float64))[0])

    @property
    def angle_rad(self) -> float:
        """The whole angle of the turn."""
        return float(np.linalg.norm(self.rotation))

    @property
    def aim(self) -> tuple[float, float, float]:
        """How far it turned right, down and clockwise, in radians, from where it looked before.

        Of a level camera these are the changes of heading, tilt and roll.
        """
        return aim_of(self.matrix)


def aim_of(matrix: Array) -> tuple[float, float, float]:
    """How far a rotation (3, 3) turns a camera right, down and clockwise: see `Turn.aim`."""
    forward, right = matrix[2], matrix[0]
    return (
        math.atan2(forward[0], forward[2]),
        math.atan2(forward[1], math.hypot(forward[0], forward[2])),
        math.atan2(right[1], math.hypot(right[0], right[2])),
    )


def turn_between(reference: Features, now: Features, intrinsics: Intrinsics) -> Turn | None:
    """The turn between two pictures of a camera; None where they do not match.

    That is no evidence of a move: it may be night, fog, or a lorry before the camera.

    Pictures may be of any size: the lens is scaled to theirs.
    """
    matches = match(reference, now, intrinsics)
    # A clock in the picture stands whatever the camera does.
    allowed = ~matches.overlay
    best = find(matches, allowed)
    if best is None or not _is_evidence(matches, best):
        return None
    standing = bool((best.agree & matches.still).sum() > 0.5 * best.agree.sum())
    if not standing and _stands_too(matches, best):
        return None
    near = False
    rival = find(matches, allowed & ~best.agree)
    if rival is not None and rival.log10_false < 0:
        wide = standing and matches.cells_of(best.agree) >= config.WIDE_CELLS
        if rival.score > (config.RIVAL_OF_WIDE if wide else config.RIVAL) * best.score:
            near = _apart_px(matches, best, rival) < 3 * matches.tolerance_px
            if not near:
                return None
    # Where the rest stands, so may the clock; where it turned, the screen tells nothing.
    among = np.ones(len(matches), bool) if standing else ~matches.still
    best = consensus_at(matches, among, best.rotation, best.log_zoom)
    if not _is_evidence(matches, best):
        return None
    turn = _refined(matches, best, reference, now, intrinsics, shifted=near)
    lens = lens_of(intrinsics, reference.width, reference.height)
    view = lens.width * lens.height / (lens.fx * lens.fy)
    # What has driven on fills a part of the view; a camera turns all of it.
    if not standing and _area(matches, best) < config.LEAST_SPREAD * turn.shared * view:
        return None
    return turn


def turned_pose(prior: CameraPose, turn: Turn) -> CameraPose:
    """The pose after a turn of a camera that had a pose: where it is, it stays."""
    return pose_from_centre(turn.matrix @ prior.rotation, prior.centre_m)


def turned_covariance(prior: CameraPose, turn: Turn) -> Array:
    """The covariance (3, 3) of tilt, roll and heading in radians (`ANGLES`) after a turn."""
    after = turn.matrix @ prior.rotation
    columns = []
    for axis in np.eye(3):
        angles = [
            np.array(angles_from_rotation(cv2.Rodrigues(sign * _STEP_RAD * axis)[0] @ after))
            for sign in (1, -1)
        ]
        change = angles[0] - angles[1]
        change[1:] = [math.remainder(each, 2 * math.pi) for each in change[1:].tolist()]
        columns.append(change / (2 * _STEP_RAD))
    slopes = np.stack(columns, axis=1)
    return np.asarray(slopes @ turn.covariance[:3, :3] @ slopes.T)


def _is_evidence(matches: Matches, found: Consensus) -> bool:
    return bool(
        found.agree.sum() >= config.FEWEST_INLIERS
        and matches.cells_of(found.agree) >= config.FEWEST_CELLS
        and found.log10_false < config.LOG10_FALSE
    )


def _area(matches: Matches, found: Consensus) -> float:
    """The area over which the matches that agree are spread: of an even rectangle, its own."""
    spread = np.cov(matches.reference[found.agree, :2].T)
    return float(12 * np.sqrt(max(np.linalg.det(spread), 0.0)))


def _stands_too(matches: Matches, found: Consensus) -> bool:
    """True where much of the picture, and no clock, stands on the screen beside what turned.

    A bus that fills the view has moved, more likely than that the camera has.
    """
    still = matches.cells_of(matches.still & ~matches.overlay & ~found.agree)
    least = config.STANDING_CELLS * matches.cells_of(found.agree)
    return still >= max(config.FEWEST_CELLS, least)


def _apart_px(matches: Matches, one: Consensus, other: Consensus) -> float:
    """How far apart two consensuses see what the first agrees on, in the median."""
    off = residuals_px(matches, other.rotation, other.log_zoom)[one.agree]
    return float(np.median(np.nan_to_num(np.linalg.norm(off, axis=-1), nan=np.inf)))


def _refined(
    matches: Matches,
    found: Consensus,
    reference: Features,
    now: Features,
    intrinsics: Intrinsics,
    *,
    shifted: bool,
) -> Turn:
    rotation, log_zoom = fitted(matches, found.agree, found.rotation, found.log_zoom, _REFITS)
    agree = consensus_at(matches, found.agree, rotation, log_zoom).agree
    off = residuals_px(matches, rotation, log_zoom)
    length = np.linalg.norm(off, axis=-1)
    # Of a two-dimensional normal distribution the median distance is 1.177 sd.
    sigma = max(float(np.median(length[agree])) / 1.177, config.LEAST_SIGMA_PX / now.analysed)
    standing = float(np.mean(matches.still[agree])) > 0.5
    disparity = 0.0 if standing else _disparity_rad(matches, agree, length)
    shifted = shifted or disparity > 0
    covariance = _covariance(matches, agree, rotation, log_zoom, sigma)
    if shifted:
        covariance = covariance * config.SHIFTED_WIDER**2
        covariance[:3, :3] += disparity**2 * np.eye(3)
    vector = np.asarray(cv2.Rodrigues(rotation)[0], np.float64).ravel()
    return Turn(
        rotation=vector,
        log_zoom=log_zoom,
        covariance=covariance + _floor(vector),
        inliers=int(agree.sum()),
        matches=len(matches),
        shared=_shared(rotation, log_zoom, reference, now, intrinsics),
        shifted=shifted,
    )


def _floor(vector: Array) -> Array:
    """The covariance (4, 4) of what no residual shows: sway, light, and a lens that is off.

    A focal length that is off by a share makes a turn about right or down off by that share.
    """
    floor = np.diag([*[config.FLOOR_RAD**2] * 3, config.FLOOR_LOG_ZOOM**2])
    aside = config.LENS_SHARE * np.array([vector[0], vector[1], 0.0])
    floor[:3, :3] += np.outer(aside, aside)
    floor[:3, :3] += np.eye(3) * (config.LENS_ACROSS * config.LENS_SHARE) ** 2 * (vector @ vector)
    return np.asarray(floor)


def _covariance(
    matches: Matches, agree: Mask, rotation: Array, log_zoom: float, sigma: float
) -> Array:
    """The covariance (4, 4): what residuals say, those of a cell of the picture being alike.

    Source: Cameron and Miller 2015, eq. 11 (clusters).
    """
    slopes, off = (
        derivatives_px(matches, rotation, log_zoom),
        residuals_px(matches, rotation, log_zoom),
    )
    length = np.linalg.norm(off, axis=-1)
    weights = biweights(length, matches.tolerance_px) * matches.weights * agree
    normal, _ = normal_of(slopes, off, weights)
    normal[3, 3] += 1.0 / config.LOG_ZOOM_SD**2
    bread = np.linalg.inv(normal + np.eye(4) * 1e-12 * np.trace(normal))
    pulls = np.einsum("mki,mk,m->mi", slopes[agree], off[agree], weights[agree])
    sums = np.zeros((config.CELLS[0] * config.CELLS[1], 4))
    np.add.at(sums, matches.cells[agree], pulls)
    cells = int((sums != 0).any(axis=1).sum())
    clustered = bread @ (sums.T @ sums) @ bread * cells / max(cells - 2, 1)
    plain = (
        bread
        @ np.einsum("mki,mkj,m->ij", slopes[agree], slopes[agree], weights[agree] ** 2)
        @ bread
    )
    share = cells / (cells + 8)
    wider = 1 + config.FEW_INLIERS / max(agree.sum(), 1)
    return np.asarray((share * clustered + (1 - share) * plain * sigma**2) * wider)


def _disparity_rad(matches: Matches, agree: Mask, length_px: Array) -> float:
    """By how much near and far things turned differently, usually; 0 where all turned alike.

    Then many more matches keep to lines towards one point than agree on a turn.
    """
    clear = ~matches.overlay
    least = max(config.SHIFTED_MORE * agree.sum(), config.SHIFTED_LEAST)
    if (clear & ~agree).sum() <= least:
        return 0.0
    reach = matches.tolerance_px / 3 / matches.focal_px
    _, mask = cv2.findEssentialMat(
        matches.reference[clear, :2], matches.now[clear, :2], np.eye(3), cv2.RANSAC, 0.999, reach
    )
    if mask is None:
        return 0.0
    lined = mask[:, 0] > 0
    if lined.sum() - agree.sum() <= least:
        return 0.0
    off = np.nan_to_num(length_px[clear][lined], nan=math.inf)
    return min(float(np.median(off)) / matches.focal_px, config.MOST_DISPARITY_RAD)


def _shared(
    rotation: Array, log_zoom: float, reference: Features, now: Features, intrinsics: Intrinsics
) -> float:
    """The share of the old view that is still in sight."""
    lens = lens_of(intrinsics, reference.width, reference.height)
    sides = [np.linspace(0, side - 1, _FACE) for side in (reference.width, reference.height)]
    rays, seen = lens.rays(np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2))
    turned = rays[seen] @ rotation.T
    turned[:, :2] *= math.exp(log_zoom)
    view = lens_of(intrinsics, now.width, now.height)
    uv, valid = view.project(turned)
    return float((view.contains(uv) & valid).sum() / max(len(rays), 1))
