"""What is wrong with a picture: covered, blinded, out of focus, black, frozen, another scene."""

from collections.abc import Sequence
from enum import StrEnum

import cv2
import numpy as np

from models.pictures import config
from models.pictures.gallery import bits_apart
from models.pictures.measures import Measures, Pixels


class PictureFault(StrEnum):
    """What is wrong with a picture."""

    FROZEN = "frozen"
    BLACK = "black"
    BLINDED = "blinded"
    COVERED = "covered"
    DEFOCUSED = "defocused"
    UPSIDE_DOWN = "upside_down"
    OTHER_SCENE = "other_scene"


def judge(
    now: Measures,
    gallery: Sequence[Measures],
    *,
    unchanged_s: float = 0.0,
    matched: bool = False,
) -> PictureFault | None:
    """What is wrong with a picture, by the camera's own gallery; None where nothing is.

    Without a gallery only a frozen or a black picture can be told.

    All pictures have had this one's `digest` for `unchanged_s`. One that `matched` the gallery is
    no other scene, and nothing covers it.
    """
    if unchanged_s >= config.FROZEN_S:
        return PictureFault.FROZEN
    dark = now.mean < config.BLACK_MEAN and now.spread < config.BLACK_SPREAD
    if dark and not any(each.spread <= 2 * now.spread for each in gallery):
        return PictureFault.BLACK
    if not gallery:
        return None
    if now.bright > max(each.bright for each in gallery) + config.BLINDED_SHARE:
        return PictureFault.BLINDED
    if matched:
        return PictureFault.DEFOCUSED if _is_blurred(now, gallery) else None
    alike = max(_alike(now.edges, each.edges) for each in gallery)
    same_form = min(bits_apart(now.phash, each.phash) for each in gallery) <= config.SAME_FORM_BITS
    fewest = min(float(each.edges.mean()) for each in gallery)
    if float(now.edges.mean()) < config.FEW_EDGES * fewest or _is_blurred(now, gallery):
        return PictureFault.DEFOCUSED if same_form else PictureFault.COVERED
    if alike >= config.ALIKE or same_form:
        return None
    turned = max(_alike(now.edges[::-1, ::-1], each.edges) for each in gallery)
    return PictureFault.UPSIDE_DOWN if turned >= config.ALIKE else PictureFault.OTHER_SCENE


def _is_blurred(now: Measures, gallery: Sequence[Measures]) -> bool:
    return now.sharpness < config.BLURRED * min(each.sharpness for each in gallery)


def _alike(one: Pixels, other: Pixels) -> float:
    """The correlation of two maps of edges, a cell more or less aside."""
    blurred = [cv2.GaussianBlur(each.astype(np.float32), (0, 0), 1.0) for each in (one, other)]
    first, second = (each - each.mean() for each in blurred)
    size = float(np.sqrt((first**2).sum() * (second**2).sum()))
    return float((first * second).sum()) / size if size > 1e-9 else 0.0
