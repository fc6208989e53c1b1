"""The references of a camera, by light: which of them a picture matches, and when one is renewed.

Each carries its turn against the first, so that renewals cannot hide a slow drift.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.pictures import config
from models.pictures.features import Features, KnownTurn
from models.pictures.measures import Measures
from models.pictures.turn import Turn, turn_between


@dataclass(frozen=True, slots=True, kw_only=True)
class BestTurn:
    """The turn against the gallery's first picture, and by which reference (index) it is.

    Both are None where no reference matches, which is no evidence of a move. `tried` of the
    references were compared.
    """

    turn: Turn | None
    reference: int | None
    tried: int


def best_turn(gallery: Sequence[Features], now: Features, intrinsics: Intrinsics) -> BestTurn:
    """The turn by the references that are likest in light, the surest of those that match."""
    order = sorted(
        range(len(gallery)), key=lambda k: light_apart(gallery[k].measures, now.measures)
    )
    best, chosen, tried = None, None, 0
    for k in order[: config.MOST_TRIED]:
        tried += 1
        found = turn_between(gallery[k], now, intrinsics)
        if found is None:
            continue
        turn = _since_first(found, gallery[k].known)
        if best is None or np.trace(turn.covariance) < np.trace(best.covariance):
            best, chosen = turn, k
        if found.inliers >= config.STRONG_INLIERS:
            break
    return BestTurn(turn=best, reference=chosen, tried=tried)


def renewed(gallery: Sequence[Features], now: Features, turn: Turn | None) -> tuple[Features, ...]:
    """The gallery with a picture that matched it, where its light is new or its match was weak.

    The first stays: one that shows too little, in fog say, begins no gallery. A picture that is
    much turned, or whose turn is not sure, becomes none.

    Turns are against the first of the gallery, as of `best_turn`.
    """
    kept = list(gallery)
    if not kept:
        return (now,) if _may_be_first(now) else ()
    if turn is None or not _may_be_reference(turn):
        return tuple(kept)
    own = replace(
        now,
        known=KnownTurn(rotation=turn.rotation, log_zoom=turn.log_zoom, covariance=turn.covariance),
    )
    apart = [light_apart(each.measures, now.measures) for each in kept]
    nearest = int(np.argmin(apart))
    if apart[nearest] < config.LIKE_LIGHT:
        if nearest and turn.inliers < config.STRONG_INLIERS:
            kept[nearest] = own
            return tuple(kept)
        if turn.inliers >= config.STRONG_INLIERS:
            return tuple(kept)
    kept.append(own)
    if len(kept) > config.MOST_REFERENCES:
        del kept[_least_needed(kept)]
    return tuple(kept)


def bridged(gallery: Sequence[Features], between: Features, turn: Turn) -> tuple[Features, ...]:
    """The gallery with a picture that matched none of it, such as the first one by infrared.

    The camera stood in one before it and in one after it, so it stood in between, as far as it
    sways: what matches neither of their lights is known by that.

    `turn` is of the next picture that matched, against the first.
    """
    if not _may_be_reference(turn) or not _may_be_first(between):
        return tuple(gallery)
    wider = np.diag([*[config.BRIDGED_SD_RAD**2] * 3, config.FLOOR_LOG_ZOOM**2])
    known = KnownTurn(
        rotation=turn.rotation, log_zoom=turn.log_zoom, covariance=turn.covariance + wider
    )
    kept = [*gallery, replace(between, known=known)]
    if len(kept) > config.MOST_REFERENCES:
        del kept[_least_needed(kept)]
    return tuple(kept)


def light_apart(one: Measures, other: Measures) -> float:
    """How different the light of two pictures is: 1 is about an hour, or a cloud."""
    return math.hypot(
        (one.mean - other.mean) / 30,
        (one.spread - other.spread) / 15,
        (one.entropy_bits - other.entropy_bits) / 0.7,
        bits_apart(one.phash, other.phash) / 16,
    )


def bits_apart(one: str, other: str) -> int:
    """Bits of two hashes, in hexadecimal digits, that differ."""
    return (int(one, 16) ^ int(other, 16)).bit_count()


def _may_be_first(now: Features) -> bool:
    """True of a picture with enough to see in enough of it: all others are compared with it."""
    size = np.array([now.width, now.height])
    cells = np.unique((now.points_px / size * config.CELLS).astype(int), axis=0)
    return len(now.points_px) >= config.FIRST_FEATURES and len(cells) >= config.FIRST_CELLS


def _may_be_reference(turn: Turn) -> bool:
    sure = math.sqrt(float(np.diag(turn.covariance)[:3].max())) < config.RENEWING_SD_RAD
    enough = turn.inliers >= config.RENEWING_INLIERS and turn.shared >= config.RENEWING_SHARED
    return sure and enough and not turn.shifted


def _least_needed(gallery: Sequence[Features]) -> int:
    """The older one of the two references, but for the first, whose light is the most alike."""
    apart = [
        min(
            light_apart(each.measures, other.measures)
            for at, other in enumerate(gallery)
            if at != k
        )
        for k, each in enumerate(gallery[:-1])
    ]
    return 1 + int(np.argmin(apart[1:]))


def _since_first(turn: Turn, known: KnownTurn) -> Turn:
    """The turn against the first reference, of one against a reference whose own is known."""
    before = cv2.Rodrigues(np.asarray(known.rotation, np.float64))[0]
    spread: Array = np.eye(4)
    spread[:3, :3] = turn.matrix  # a turn on the left of the reference's comes after R, too
    return replace(
        turn,
        rotation=np.asarray(cv2.Rodrigues(turn.matrix @ before)[0], np.float64).ravel(),
        log_zoom=turn.log_zoom + known.log_zoom,
        covariance=turn.covariance + spread @ known.covariance @ spread.T,
    )
