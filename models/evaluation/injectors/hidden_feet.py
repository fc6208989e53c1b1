"""Feet behind things that stand at the site: the box ends where the lower body is cut off."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.evaluation.injectors.view import USUAL_STATURE_M, View, ground_of, seen_again
from models.evaluation.scenes import SceneTrack
from models.geometry.rotation import Array

_WIDTH_M = (1.0, 4.0)
_TALL_M = (0.5, 0.9)  # a bench, a hedge, a parked car's bonnet
_IN_FRONT_M = (0.5, 4.0)  # of somebody who walks there
_MOST_HIDDEN = 0.6  # of a person; of whom more is hidden nobody is detected
_MOST_THINGS = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Thing:
    """What hides feet: its place (2,) from the camera's foot, half its width and its height."""

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
    """How much (N,) in metres of upright people at places (N, 2) a thing hides, 0 for none.

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


def _behind(track: SceneTrack, view: View, things: Sequence[Thing]) -> SceneTrack | None:
    ground, valid = ground_of(track, view)
    pose = view.pose
    places = np.where(valid[:, None], ground - pose.centre_m[:2], 0.0)
    cut = np.max([hidden_m(places, thing, pose.height_m) for thing in things], axis=0, initial=0.0)
    if not (cut > 0).any():
        return track
    points = np.concatenate([ground, cut[:, None]], axis=1) - pose.centre_m
    raised, _ = view.intrinsics.project(points @ pose.rotation.T)
    uv = np.where((cut > 0)[:, None], raised, track.trajectory.uv)
    uv[cut > _MOST_HIDDEN * USUAL_STATURE_M] = np.nan
    return seen_again(track, view, uv, track.trajectory.top_v)
