from dataclasses import replace
from itertools import combinations, product
from math import degrees, radians

import numpy as np
import pytest

from models.pictures import config
from models.pictures.features import describe
from models.pictures.gallery import best_turn, bridged, light_apart, renewed
from models.pictures.turn import turned_pose
from tests.models.pictures.given import LENS, PRIOR, seen_after, wall


def lit(grey, gain, lift=0.0):
    return np.clip(grey * gain + lift, 0, 255).astype(np.uint8)


def test_the_reference_of_the_same_light_is_asked_first():
    gallery = [describe(lit(wall(), gain)) for gain in (1.0, 0.3)]
    found = best_turn(gallery, describe(lit(wall(), 0.32)), LENS)
    assert (found.reference, found.tried) == (1, 1)


def test_what_matched_nothing_joins_at_the_turn_of_the_next_that_did():
    gallery = (describe(wall()),)
    night = describe(255 - wall())
    assert best_turn(gallery, night, LENS).turn is None
    turn = best_turn(gallery, describe(wall()), LENS).turn
    both = bridged(gallery, night, turn)
    assert len(both) == 2
    found = best_turn(both, describe(255 - wall()), LENS).turn
    assert found.angle_rad < radians(0.05)
    # As sure as two pictures are of what was between them.
    assert np.sqrt(np.diag(found.covariance)[:3]).min() > config.BRIDGED_SD_RAD
    assert bridged(gallery, night, replace(turn, shared=0.5)) == gallery


def test_no_match_is_no_turn():
    found = best_turn([describe(wall(0))], describe(wall(1)), LENS)
    assert (found.turn, found.reference, found.tried) == (None, None, 1)
    assert best_turn([], describe(wall(1)), LENS).turn is None


def test_renewals_do_not_hide_a_slow_drift():
    """Each picture has turned by 0.3 deg more, and is darker than the one before it."""
    gallery = renewed((), describe(wall()), None)
    for step in range(1, 6):
        after = replace(PRIOR, heading_rad=PRIOR.heading_rad + radians(0.3 * step))
        now = describe(lit(seen_after(wall(), PRIOR, after), 0.8**step))
        found = best_turn(gallery[-1:], now, LENS)
        gallery = renewed(gallery, now, found.turn)
    assert len(gallery) > 2
    heading = turned_pose(PRIOR, found.turn).heading_rad
    assert degrees(heading - PRIOR.heading_rad) == pytest.approx(1.5, abs=0.1)


def test_a_gallery_keeps_its_first_and_no_more_than_eight():
    first = describe(wall())
    turn = best_turn((first,), first, LENS).turn
    gallery = renewed((), first, None)
    for mean, spread in product(range(10, 250, 15), (20.0, 60.0)):
        light = {"mean": float(mean), "spread": spread}
        now = replace(first, measures=replace(first.measures, **light))
        gallery = renewed(gallery, now, turn)
    assert gallery[0] is first
    assert len(gallery) == config.MOST_REFERENCES
    apart = [light_apart(a.measures, b.measures) for a, b in combinations(gallery[1:], 2)]
    assert min(apart) >= config.LIKE_LIGHT


def test_a_picture_that_is_not_known_to_be_of_this_view_becomes_no_reference():
    gallery = (describe(wall()),)
    dark = describe(lit(wall(), 0.3))
    turn = best_turn(gallery, dark, LENS).turn
    assert len(renewed(gallery, dark, turn)) == 2
    for wrong in (
        None,
        replace(turn, shifted=True),
        replace(turn, shared=0.5),
        replace(turn, inliers=9),
    ):
        assert renewed(gallery, dark, wrong) == gallery


def test_a_picture_that_shows_nothing_begins_no_gallery():
    fog = np.full_like(wall(), 180)
    lamp = fog.copy()
    lamp[100:200, 100:200] = wall()[100:200, 100:200]
    for grey in (fog, lamp):
        assert renewed((), describe(grey), None) == ()


def test_light_apart_is_nothing_of_the_same_picture():
    measures = describe(wall()).measures
    assert light_apart(measures, measures) == 0
    assert light_apart(measures, replace(measures, mean=measures.mean + 30)) == pytest.approx(1)
