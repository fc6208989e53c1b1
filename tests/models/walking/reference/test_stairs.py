"""Room for stairs: where there are some and nowhere else; poses beside them are right."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from models.geometry.ground import ground_from_pixel
from models.geometry.plane_parameters import plane_parameters_of
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import SceneTrack
from models.walking.estimate import joint_estimate
from models.walking.field import field_over
from models.walking.fit import assumed
from models.walking.reference import stairs as room_for_stairs
from models.walking.reference.learning import learn_speed_reference
from models.walking.serialization import reference_from_bytes, reference_to_bytes
from studies.faults.lens_and_ground import stairs
from studies.faults.view import View
from tests.models.sites import KNOCKED, LENS, PRIOR, seen, tracks_of
from tests.models.walking.test_field import SHAPE, measured_at
from tests.models.walking.test_hierarchy import SPREAD

FLIGHT_M = 1.5
SITE, DIRECTION = 6, 1


def places_of(tracks):
    uv = np.concatenate([track.uv for track in tracks])
    places, valid = ground_from_pixel(LENS, PRIOR.rotation, PRIOR.centre_m, uv)
    return places[valid]


def on_stairs(tracks, pose, places):
    """The tracks as they are with a flight of stairs at the site, the same before every pose."""
    view = View(intrinsics=LENS, pose=pose, recorded=PRIOR, places=places, span_s=(0, 1))
    named = [SceneTrack(track_id=str(n), trajectory=track) for n, track in enumerate(tracks)]
    found = stairs(named, view, FLIGHT_M, DIRECTION)
    return [each.trajectory for each in found if each.trajectory.long_enough]


@pytest.fixture(scope="module")
def level():
    return tracks_of(SITE, (PRIOR, 200), (KNOCKED, 150))


@pytest.fixture(scope="module")
def climbed(level):
    places = places_of(level[0])
    return [
        on_stairs(tracks, pose, places)
        for tracks, pose in zip(level, (PRIOR, KNOCKED), strict=True)
    ]


def learned(tracks):
    return learn_speed_reference(seen(tracks), PRIOR, WalkConfig(), 0)


@pytest.fixture(scope="module")
def reference(climbed):
    return learned(climbed[0])


def test_stairs_are_found_where_they_are(level, reference):
    bumps = reference.speeds.field.abrupt
    assert bumps is not None
    # The injector's own line: beyond it lie three tenths of the places.
    angle = np.random.default_rng(DIRECTION).uniform(0, 2 * np.pi)
    uphill = np.array([np.cos(angle), np.sin(angle)])
    begins = np.quantile(places_of(level[0]) @ uphill, 0.7)
    own = bumps.centres - (PRIOR.x_m, PRIOR.y_m)
    weights = np.abs(reference.speeds.mean[-len(own) :])
    # On the plane, a flight of 1.5 m over 2.6 m of ground reaches a third farther from the camera.
    middle = np.average(own @ uphill, weights=weights)
    assert begins - 1 < middle < begins + 6


def test_where_nobody_climbs_nothing_is_found(level):
    assert learned(level[0]).speeds.field.abrupt is None


def test_where_nobody_moves_nothing_is_found(level):
    slow = [replace(track, time_s=track.time_s * 20) for track in level[0]]
    assert learned(slow).speeds.field.abrupt is None


def test_where_some_dawdle_nothing_is_found(level):
    """A third of the people take one stretch at a third of their pace: a shop window."""
    places = places_of(level[0])
    middle = np.median(places, axis=0)
    tracks = []
    for number, track in enumerate(level[0]):
        ground, _ = ground_from_pixel(LENS, PRIOR.rotation, PRIOR.centre_m, track.uv)
        near = np.linalg.norm(ground - middle, axis=1) < 4
        slow = np.where(near[1:] & (number % 3 == 0), 3.0, 1.0)
        times = track.time_s[0] + np.concatenate([[0.0], np.cumsum(np.diff(track.time_s) * slow)])
        tracks.append(replace(track, time_s=times))
    assert learned(tracks).speeds.field.abrupt is None


def test_a_pose_beside_stairs_is_nearer_the_truth(climbed, reference, monkeypatch):
    def off(known):
        return joint_estimate(seen(climbed[1]), PRIOR, known).values - plane_parameters_of(KNOCKED)

    with_room = np.abs(off(reference))
    monkeypatch.setattr(room_for_stairs, "abrupt_bumps", lambda *_: None)
    without = np.abs(off(learned(climbed[0])))
    assert np.hypot(*with_room[:2]) < 0.7 * np.hypot(*without[:2])
    assert with_room[2] < 0.7 * without[2]


def test_what_is_stored_is_read(climbed, reference):
    stored = reference_from_bytes(reference_to_bytes(reference))
    assert_array_equal(stored.speeds.field.abrupt.centres, reference.speeds.field.abrupt.centres)
    before, after = (
        joint_estimate(seen(climbed[1]), PRIOR, known) for known in (reference, stored)
    )
    assert_array_equal(after.values, before.values)
    assert_array_equal(after.covariance, before.covariance)


def test_no_more_places_have_room_than_may():
    """Twenty people slow down at eight places of two cells, 3 x 4 cells with their neighbours."""
    x, y, person = (each.ravel() for each in np.meshgrid(range(34), range(4), range(20)))
    order = np.argsort(person, kind="stable")
    x, y, person = x[order], y[order], person[order]
    slow = (x % 4 == 1) & (x < 32) & ((y == 1) | (y == 2))
    value = np.log(1.4) + np.random.default_rng(4).normal(0, 0.05, len(x)) - 0.9 * slow
    measured = measured_at(np.column_stack([x, y]) * 2.0)
    rows = replace(measured.rows, owner_idx=person, owners=20)
    measured = replace(measured, value=value, rows=rows)
    field = field_over(measured, replace(SHAPE, level=float(np.log(1.4))))
    bumps = room_for_stairs.abrupt_bumps(measured, assumed(field, SPREAD))
    # Six of the eight: seven would be 84 bumps, and 80 are allowed.
    _, counts = np.unique(bumps.centres[:, 0] // 8, return_counts=True)
    assert list(counts) == [12] * 6
    assert len(np.unique(bumps.centres, axis=0)) == 72
