"""The turn and zoom that most matches agree on: by pairs of them, then by robust least squares.

A camera that turned by R and zoomed by z sees the ray x of before at the direction (z, z, 1) R x.
Two matches determine both; OpenCV has no such model, so the consensus (Fischler and Bolles 1981)
is looked for here, all samples at once.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.stats import binom

from models.geometry.rotation import Array, Mask
from models.pictures import config
from models.pictures.matching import Indices, Matches

_CONVERGED = 1e-9
_JUDGED = 400  # matches that samples are scored by: of more, as many are enough
_AT_ONCE, _STARTS = 250, 8  # samples of a round; starts that are climbed from
_MISSED = 1e-6  # of consensuses, by bad luck with the samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Consensus:
    """A rotation `now_from_reference` (3, 3), a log zoom, and the matches that agree (M,).

    `score` counts them, no cell of the picture for more than a few; `log10_false` is the log of
    how many such consensuses chance alone would give.
    """

    rotation: Array
    log_zoom: float
    agree: Mask
    score: float
    log10_false: float


def residuals_px(matches: Matches, rotation: Array, log_zoom: float) -> Array:
    """How far off (..., M, 2) the matches are by rotations (..., 3, 3) and log zooms (...)."""
    turned = matches.reference @ np.swapaxes(rotation, -1, -2)
    depth = turned[..., 2]
    zoom = np.exp(np.asarray(log_zoom))[..., None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = zoom * turned[..., :2] / np.where(depth > 1e-3, depth, np.nan)[..., None]
    return np.asarray((seen - matches.now[:, :2]) * matches.focal_px)


def find(matches: Matches, allowed: Mask, seed: int = 0) -> Consensus | None:
    """The best consensus of the matches that are allowed (M,); None of fewer than two."""
    of = np.flatnonzero(allowed)
    if len(of) < 2:
        return None
    draw = np.random.default_rng(seed)
    judged = of if len(of) <= _JUDGED else np.sort(draw.choice(of, _JUDGED, replace=False))
    starts: list[tuple[float, Array, float]] = []
    tried, needed = 0, config.SAMPLES
    while tried < needed:
        pairs = of[draw.integers(0, len(of), (_AT_ONCE, 2))]
        rotations, zooms = _by_pairs(matches, pairs[pairs[:, 0] != pairs[:, 1]])
        scores = _scores(matches, judged, rotations, zooms)
        likely = np.argsort(-scores, kind="stable")[:_STARTS].tolist()
        starts += [(float(scores[k]), rotations[k], float(zooms[k])) for k in likely]
        tried += _AT_ONCE
        share = max((each[0] for each in starts), default=0.0) / matches.weights[judged].sum()
        needed = min(config.SAMPLES, _samples_for(share))
    best: Consensus | None = None
    for _, start, log_zoom in sorted(starts, key=lambda each: -each[0])[:_STARTS]:
        rotation, zoom = fitted(matches, allowed, start, log_zoom, 3)
        made = consensus_at(matches, allowed, rotation, zoom)
        if best is None or made.score > best.score:
            best = made
    return best


def _samples_for(share: float) -> int:
    """How many pairs are enough for one of two right matches, where such a share is right."""
    if share >= 1:
        return 1
    return math.ceil(math.log(_MISSED) / math.log1p(-(max(share, 0.01) ** 2)))


def consensus_at(matches: Matches, allowed: Mask, rotation: Array, log_zoom: float) -> Consensus:
    """The matches, of those allowed, that agree with a rotation and a zoom."""
    off = np.linalg.norm(residuals_px(matches, rotation, log_zoom), axis=-1)
    agree = (off < matches.tolerance_px) & allowed
    weight = np.where(agree, 1 - (off / matches.tolerance_px) ** 2, 0.0)
    count, inliers = int(allowed.sum()), int(agree.sum())
    return Consensus(
        rotation=rotation,
        log_zoom=log_zoom,
        agree=agree,
        score=float((matches.weights * np.nan_to_num(weight)).sum()),
        log10_false=_log10_false(matches, count, inliers),
    )


def fitted(
    matches: Matches, allowed: Mask, rotation: Array, log_zoom: float, steps: int = 1
) -> tuple[Array, float]:
    """The rotation and zoom by Gauss-Newton with Tukey's weights of what is within reach."""
    for _ in range(steps):
        off = residuals_px(matches, rotation, log_zoom)
        length = np.linalg.norm(off, axis=-1)
        weights = biweights(length, matches.tolerance_px) * matches.weights * allowed
        if np.count_nonzero(weights) < 3:
            break
        slopes = derivatives_px(matches, rotation, log_zoom)
        step = step_of(slopes, off, weights, log_zoom)
        rotation = cv2.Rodrigues(step[:3])[0] @ rotation
        log_zoom = float(np.clip(log_zoom + step[3], -config.MOST_LOG_ZOOM, config.MOST_LOG_ZOOM))
        if np.abs(step).max() < _CONVERGED:
            break
    return rotation, log_zoom


def biweights(length: Array, reach: float) -> Array:
    """Tukey's weights (M,) of residuals' lengths; 0 of what is beyond the reach or NaN."""
    share = np.nan_to_num(length / reach, nan=np.inf)
    return np.asarray(np.where(share < 1, (1 - np.minimum(share, 1) ** 2) ** 2, 0.0))


def derivatives_px(matches: Matches, rotation: Array, log_zoom: float) -> Array:
    """Derivatives (M, 2, 4) of residuals by a turn on the left of the rotation, and log zoom."""
    x, y, z = np.moveaxis(matches.reference @ rotation.T, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = np.where(z > 1e-3, (x / z, y / z), np.nan)
    zoom = math.exp(log_zoom)
    across = np.stack([-u * v, 1 + u * u, -v, u], axis=-1)
    down = np.stack([-(1 + v * v), u * v, u, v], axis=-1)
    return np.asarray(np.stack([across, down], axis=-2) * (zoom * matches.focal_px))


def step_of(slopes: Array, off: Array, weights: Array, log_zoom: float) -> Array:
    """The Gauss-Newton step (4,), with the zoom's prior."""
    normal, gradient = normal_of(slopes, off, weights)
    hold = 1.0 / config.LOG_ZOOM_SD**2
    normal[3, 3] += hold
    gradient[3] += hold * log_zoom
    normal += np.eye(4) * 1e-9 * max(float(np.trace(normal)), 1e-12)
    return np.asarray(np.linalg.solve(normal, -gradient))


def normal_of(slopes: Array, off: Array, weights: Array) -> tuple[Array, Array]:
    """The normal matrix (4, 4) and gradient (4,) of what has a weight."""
    some = weights > 0
    j, r, w = slopes[some], off[some], weights[some]
    weighted = j * w[:, None, None]
    return np.einsum("mki,mkj->ij", weighted, j), np.einsum("mki,mk->i", weighted, r)


def _by_pairs(matches: Matches, pairs: Indices) -> tuple[Array, Array]:
    """Rotations (K, 3, 3) and log zooms (K,) by pairs (P, 2): with the zoom that fits, and none."""
    before = [_unit(matches.reference[pairs[:, k]]) for k in (0, 1)]
    c, d = (matches.now[pairs[:, k], :2] for k in (0, 1))
    cosine = (before[0] * before[1]).sum(axis=1)
    log_zooms = _zoom_between(cosine, c, d)
    rotations, zooms = [], []
    for log_zoom in (np.zeros(len(pairs)), log_zooms):
        scale = np.exp(-log_zoom)[:, None]
        ones = np.ones((len(pairs), 1))
        after = [_unit(np.concatenate([each * scale, ones], axis=1)) for each in (c, d)]
        rotations.append(_frames(*after) @ np.swapaxes(_frames(*before), -1, -2))
        zooms.append(log_zoom)
    made, own = np.concatenate(rotations), np.concatenate(zooms)
    usable = np.isfinite(made).all(axis=(1, 2)) & np.isfinite(own)
    return made[usable], own[usable]


def _zoom_between(cosine: Array, c: Array, d: Array) -> Array:
    """Log zooms (P,) by which two directions now are as far apart as their rays were before.

    With w = 1 / zoom^2: (1 + w c.d)^2 = cosine^2 (1 + w c.c) (1 + w d.d). NaN where none is.
    """
    squared = cosine**2
    cc, dd, cd = (c * c).sum(axis=1), (d * d).sum(axis=1), (c * d).sum(axis=1)
    quadratic, linear, constant = (
        cd**2 - squared * cc * dd,
        2 * cd - squared * (cc + dd),
        1 - squared,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(linear**2 - 4 * quadratic * constant)
        roots = np.stack([(-linear + s * root) / (2 * quadratic) for s in (1, -1)])
        log_zooms = -0.5 * np.log(np.where(roots > 0, roots, np.nan))
    likely = np.where(np.abs(log_zooms) < config.MOST_LOG_ZOOM, np.abs(log_zooms), np.inf)
    nearest = likely.argmin(axis=0)
    chosen = log_zooms[nearest, np.arange(len(cosine))]
    return np.asarray(np.where(np.isfinite(likely.min(axis=0)), chosen, np.nan))


def _frames(first: Array, second: Array) -> Array:
    """Right-handed frames (P, 3, 3), in columns, of pairs of unit directions (P, 3)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = _unit(first + second)
        normal = _unit(np.cross(first, second))
    return np.stack([middle, np.cross(normal, middle), normal], axis=-1)


def _unit(vectors: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _scores(matches: Matches, judged: Indices, rotations: Array, log_zooms: Array) -> Array:
    """The scores (K,) of rotations and zooms by some of the matches."""
    reference, now = matches.reference[judged], matches.now[judged, :2]
    squared_reach = (matches.tolerance_px / matches.focal_px) ** 2
    turned = np.einsum("kij,mj->ikm", rotations, reference)
    zoom = np.exp(log_zooms)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = zoom / np.where(turned[2] > 1e-3, turned[2], np.nan)
        off = (turned[0] * depth - now[:, 0]) ** 2 + (turned[1] * depth - now[:, 1]) ** 2
    near = np.maximum(1 - np.nan_to_num(off, nan=np.inf) / squared_reach, 0.0)
    return np.asarray(near @ matches.weights[judged])


def _log10_false(matches: Matches, count: int, inliers: int) -> float:
    """Log of the expected number of as large consensuses of `count` matches that are chance's.

    Source: Moisan and Stival 2004, eq. 6, for two matches that determine a model.
    """
    if inliers <= 2:
        return math.log10(max(count, 1))
    area = math.pi * (matches.tolerance_px / matches.focal_px) ** 2
    spread = np.ptp(matches.now[:, :2], axis=0).prod()
    chance = min(area / max(float(spread), area), 1.0)
    tail = float(binom.logsf(inliers - 3, count - 2, chance)) / math.log(10)
    return math.log10(count**2 / 2) + tail
