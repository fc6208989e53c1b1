"""People and wheels that are no walkers, on the ways of a scene's own people at another pace.

They are simulated: the ways, sampling and noise are recorded, the pace and the shape are made up.
An id says what its track is: `cyclist-17`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from models.geometry.ground import pixel_from_ground
from models.geometry.rotation import Array
from models.geometry.upright import statures, tops_seen
from models.tracks.scenes import SceneTrack
from studies.faults.view import View, ground_of, own_rng, seen_again
from studies.faults.ways import Way, taken_again, way_of

CYCLIST_MPS, CYCLIST_LOG_SD, CYCLIST_M = 4.2, 0.2, 1.75
CAR_MPS, CAR_LOG_SD, CAR_M, CAR_HALF_WIDTH_M = 7.0, 0.3, 1.5, 0.9
RUNNER_MPS, RUNNER_LOG_SD = 3.0, 0.15
WALKER_MPS, WALKER_LOG_SD = 1.3, 0.18
STROLLER_MPS, STROLLER_AHEAD_M = 1.1, 0.9
STANDING_S = (20.0, 60.0)

_Made = Callable[[SceneTrack, View, Way, np.random.Generator], SceneTrack | None]


def cyclists(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks of which a share `size` ride: 4.2 m/s in the median (log sd 0.2), steadily."""
    return _instead(tracks, view, size, seed, "cyclist", _cyclist)


def cars(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks of which a share `size` drive: 7 m/s (log sd 0.3), 1.5 m tall and 1.8 m wide.

    The lower edge of the box is at the near side of the car.
    """
    return _instead(tracks, view, size, seed, "car", _car)


def runners(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks of which a share `size` run: 3 m/s in the median (log sd 0.15)."""
    return _instead(tracks, view, size, seed, "runner", _runner)


def strollers(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks of which a share `size` push a stroller 0.9 m ahead of them, at 1.1 m/s (log sd 0.18).

    One box holds both: its lower edge is that of whichever stands lower in the picture.
    """
    return _instead(tracks, view, size, seed, "stroller", _stroller)


def standers(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks of which a share `size` stop somewhere on their way for 20 to 60 s."""
    return _instead(tracks, view, size, seed, "stander", _stander)


def other_paths(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks of which a share `size` go where the mirror image of the site's people would.

    On the ground, left for right about the line from the camera's foot to the middle of the site: a
    pace stays as it is, and no pose of a camera makes it of the old paths. Whom it takes out of the
    picture is not seen.
    """
    foot = view.recorded.centre_m[:2]
    towards = np.median(view.places, axis=0) - foot
    mirror = 2 * np.outer(towards, towards) / (towards @ towards) - np.eye(2)
    found = []
    for track in tracks:
        seen: SceneTrack | None = track
        if own_rng(track.person_id or track.track_id, seed).uniform() < size:
            ground, _ = ground_of(track, view)
            ground, top_v = foot + (ground - foot) @ mirror, track.trajectory.top_v
            if top_v is not None:
                pose, lens, own = view.pose, view.intrinsics, track.trajectory
                tall, _ = statures(lens, pose.rotation, pose.height_m, own.uv, top_v)
                top_v = tops_seen(lens, pose.rotation, pose.centre_m, ground, tall)
            seen = seen_again(track, view, _pixels(ground, view), top_v)
        found.append(seen)
    return [track for track in found if track is not None]


def _instead(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int, kind: str, make: _Made
) -> list[SceneTrack]:
    found = []
    for track in tracks:
        rng = own_rng(track.person_id or track.track_id, seed)
        way = way_of(track, view) if rng.uniform() < size else None
        made: SceneTrack | None = track
        if way is not None:
            named = replace(track, track_id=f"{kind}-{track.track_id}")
            made = make(named, view, way, rng)
        if made is not None:
            found.append(made)
    return sorted(found, key=lambda track: float(track.trajectory.time_s[0]))


def _steadily(way: Way, speed_mps: float) -> Array:
    """Distance (N,) at each interval of somebody who keeps a speed to the end of a way."""
    return np.asarray(np.arange(0.0, way.length_m, speed_mps * way.interval_s))


def _pace(median_mps: float, log_sd: float, rng: np.random.Generator) -> float:
    return median_mps * math.exp(rng.normal(0, log_sd))


def _cyclist(
    track: SceneTrack, view: View, way: Way, rng: np.random.Generator
) -> SceneTrack | None:
    along = _steadily(way, _pace(CYCLIST_MPS, CYCLIST_LOG_SD, rng))
    return taken_again(track, view, way, along, CYCLIST_M)


def _runner(track: SceneTrack, view: View, way: Way, rng: np.random.Generator) -> SceneTrack | None:
    return taken_again(track, view, way, _steadily(way, _pace(RUNNER_MPS, RUNNER_LOG_SD, rng)))


def _car(track: SceneTrack, view: View, way: Way, rng: np.random.Generator) -> SceneTrack | None:
    along = _steadily(way, _pace(CAR_MPS, CAR_LOG_SD, rng))
    made = taken_again(track, view, way, along, CAR_M)
    if made is None:
        return None
    ground, _ = ground_of(made, view)
    to_camera = view.pose.centre_m[:2] - ground
    near = ground + CAR_HALF_WIDTH_M * to_camera / np.linalg.norm(to_camera, axis=1, keepdims=True)
    uv = made.trajectory.uv.copy()
    uv[:, 1] = _pixels(near, view)[:, 1]
    return seen_again(made, view, uv, made.trajectory.top_v)


def _stroller(
    track: SceneTrack, view: View, way: Way, rng: np.random.Generator
) -> SceneTrack | None:
    along = _steadily(way, _pace(STROLLER_MPS, WALKER_LOG_SD, rng))
    made = taken_again(track, view, way, along)
    if made is None:
        return None
    ground, _ = ground_of(made, view)
    first = int(np.rint((made.trajectory.time_s[0] - track.trajectory.time_s[0]) / way.interval_s))
    there = along[first : first + len(ground)]
    ahead = way.at(np.minimum(there + 0.1, way.length_m)) - way.at(np.maximum(there - 0.1, 0.0))
    wheel = _pixels(
        ground + STROLLER_AHEAD_M * ahead / np.linalg.norm(ahead, axis=1, keepdims=True), view
    )
    feet = made.trajectory.uv
    uv = np.stack([(feet[:, 0] + wheel[:, 0]) / 2, np.fmax(feet[:, 1], wheel[:, 1])], axis=1)
    return seen_again(made, view, uv, made.trajectory.top_v)


def _stander(
    track: SceneTrack, view: View, way: Way, rng: np.random.Generator
) -> SceneTrack | None:
    along = _steadily(way, _pace(WALKER_MPS, WALKER_LOG_SD, rng))
    stop = int(rng.integers(along.size))
    still = np.full(int(rng.uniform(*STANDING_S) / way.interval_s), along[stop])
    return taken_again(track, view, way, np.concatenate([along[:stop], still, along[stop:]]))


def _pixels(ground: Array, view: View) -> Array:
    pose = view.pose
    return pixel_from_ground(view.intrinsics, pose.rotation, pose.centre_m, ground)[0]
