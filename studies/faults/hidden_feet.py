"""Feet behind things that stand at the site or pass by: the box ends where the body is cut off."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array
from models.tracks.scenes import SceneTrack
from studies.faults.view import (
    USUAL_STATURE_M,
    View,
    ground_of,
    own_rng,
    seen_again,
)

_WIDTH_M = (1.0, 4.0)
_TALL_M = (0.5, 0.9)  # a bench, a hedge, a parked car's bonnet
_IN_FRONT_M = (0.5, 4.0)  # of somebody who walks there
_MOST_HIDDEN = 0.6  # of a person; of whom more is hidden nobody is detected
_MOST_THINGS = 400
_PASSING_S = (1.0, 4.0)
_PASSING_M = (0.3, 0.9)  # of a person behind a cart, a child, a car that goes by


@dataclass(frozen=True, slots=True, kw_only=True)
class Thing:
    """Object that hides feet: place (2,) from the camera's foot, half its width, and height."""

    place_m: Array
    half_width_m: float
    tall_m: float


def hidden_feet(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks past things that hide the feet of a share `size` of the scene's places.

    Things stand on the ground in front of where people walk, the same before and after a move. What
    is left of a person ends where the sight line over the thing meets them, above the ground: the
    lower edge of the box is there. Somebody hidden by more than 60 % is not seen at all.
    """
    things = draw_things(view, size, seed)
    return [track for track in (_behind(track, view, things) for track in tracks) if track]


def draw_things(view: View, size: float, seed: int) -> list[Thing]:
    """Things that hide a share `size` of a view's places from where the camera was recorded.

    One after another is put in front of a place until so many are hidden, 400 at most.
    """
    rng = np.random.default_rng(seed)
    camera = view.recorded
    places = view.places - camera.centre_m[:2]
    hidden = np.zeros(len(places), dtype=bool)
    things: list[Thing] = []
    while len(things) < _MOST_THINGS and hidden.mean() < size:
        place = places[rng.integers(len(places))]
        away = float(np.linalg.norm(place))
        before = rng.uniform(*_IN_FRONT_M)
        thing = Thing(
            place_m=place * max(away - before, 0.3 * away) / max(away, 1e-9),
            half_width_m=rng.uniform(*_WIDTH_M) / 2,
            tall_m=min(rng.uniform(*_TALL_M), 0.5 * camera.height_m),
        )
        now = hidden | (hidden_m(places, thing, camera.height_m) > 0)
        if now.mean() > size + 0.1:
            continue  # one that hides half of the site is no bench
        hidden = now
        things.append(thing)
    return things


def hidden_m(places: Array, thing: Thing, camera_m: float) -> Array:
    """Metres (N,) of upright people at places (N, 2) that a thing hides, 0 for none.

    Places are metres from the camera's foot, `camera_m` its height. A sight line over the upper
    edge of a thing at distance d and height h meets a person at distance D > d at the height
    H - (H - h) D / d.
    """
    away = np.linalg.norm(thing.place_m)
    towards = thing.place_m / away
    along = places @ towards
    aside = places @ np.array([-towards[1], towards[0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        at_thing = np.abs(aside) * away / along
        tall = camera_m - (camera_m - thing.tall_m) * along / away
    behind = (along > away) & (at_thing <= thing.half_width_m)
    return np.where(behind, np.maximum(tall, 0.0), 0.0)


def jumps(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks whose feet jump with the box, for a share `size` of the time.

    Something that passes hides the lowest 0.3 to 0.9 m of a person for 1 to 4 s: the box's lower
    edge springs up, stays as far above the feet, and springs back. When and how much is each
    track's own, and has nothing to do with the place.
    """
    return [
        seen
        for track in tracks
        if (seen := _cut_below(track, view, _passing_m(track, size, seed))) is not None
    ]


def _passing_m(track: SceneTrack, size: float, seed: int) -> Array:
    """Metres (N,) of a track's person that something that passes hides, 0 for none."""
    rng, time_s = own_rng(track.track_id, seed), track.trajectory.time_s
    cut = np.zeros(time_s.size)
    usual_s = (_PASSING_S[0] + _PASSING_S[1]) / 2 * (1 - size) / size if size > 0 else np.inf
    from_s = float(time_s[0]) if rng.uniform() < size else time_s[0] + rng.exponential(usual_s)
    while from_s <= time_s[-1]:
        until_s = from_s + rng.uniform(*_PASSING_S)
        cut[(time_s >= from_s) & (time_s < until_s)] = rng.uniform(*_PASSING_M)
        from_s = until_s + rng.exponential(usual_s)
    return cut


def _behind(track: SceneTrack, view: View, things: Sequence[Thing]) -> SceneTrack | None:
    ground, valid = ground_of(track, view)
    pose = view.pose
    places = np.where(valid[:, None], ground - pose.centre_m[:2], 0.0)
    cut = np.max([hidden_m(places, thing, pose.height_m) for thing in things], axis=0, initial=0.0)
    return _cut_below(track, view, cut)


def _cut_below(track: SceneTrack, view: View, cut_m: Array) -> SceneTrack | None:
    """The track of somebody whose lowest metres (N,) are not seen: its feet are above the ground.

    The upper edges of the boxes stay. Where more than 60 % are hidden there is no point.
    """
    hidden = cut_m > 0
    if not hidden.any():
        return track
    ground, _ = ground_of(track, view)
    pose = view.pose
    points = np.concatenate([ground, cut_m[:, None]], axis=1) - pose.centre_m
    raised, _ = view.intrinsics.project(points @ pose.rotation.T)
    uv = np.where(hidden[:, None], raised, track.trajectory.uv)
    uv[cut_m > _MOST_HIDDEN * USUAL_STATURE_M] = np.nan
    return seen_again(track, view, uv, track.trajectory.top_v)
