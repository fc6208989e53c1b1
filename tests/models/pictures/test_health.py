import cv2
import numpy as np
import pytest

from models.pictures.config import FROZEN_S
from models.pictures.health import PictureFault, judge
from models.pictures.measures import measure
from tests.models.pictures.given import wall


def noisy(grey, seed=1):
    noise = np.random.default_rng(seed).normal(0, 3, grey.shape)
    return np.clip(grey + noise, 0, 255).astype(np.uint8)


GALLERY = [measure(noisy((wall() * gain).astype(np.uint8))) for gain in (1.0, 0.5)]
BLURRED = cv2.GaussianBlur(wall(), (0, 0), 8)
HAND = noisy(np.full_like(wall(), 60))


@pytest.mark.parametrize(
    ("grey", "fault"),
    [
        (noisy(wall(), 5), None),
        ((wall() * 0.7).astype(np.uint8), None),
        (noisy(BLURRED), PictureFault.DEFOCUSED),
        (HAND, PictureFault.COVERED),
        (np.full_like(wall(), 3), PictureFault.BLACK),
        (np.minimum(wall().astype(int) + 190, 255).astype(np.uint8), PictureFault.BLINDED),
        (wall()[::-1, ::-1].copy(), PictureFault.UPSIDE_DOWN),
        (noisy(wall(3)), PictureFault.OTHER_SCENE),
    ],
)
def test_what_is_wrong_is_named(grey, fault):
    assert judge(measure(grey), GALLERY) == fault


def test_a_frozen_picture_is_one_that_stays_for_hours():
    same = measure(wall())
    assert judge(same, GALLERY, unchanged_s=FROZEN_S - 1) is None
    assert judge(same, GALLERY, unchanged_s=FROZEN_S) == PictureFault.FROZEN
    assert measure(wall()).digest == same.digest
    assert measure(noisy(wall())).digest != same.digest


def test_a_night_that_the_gallery_knows_is_no_fault():
    night = measure(np.full_like(wall(), 3))
    assert judge(night, []) == PictureFault.BLACK
    assert judge(night, [*GALLERY, night]) is None


def test_a_picture_that_matches_is_no_other_scene():
    assert judge(measure(wall(3)), GALLERY, matched=True) is None
