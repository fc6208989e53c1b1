"""View of an injector: the camera beside its tracks, and what several injectors compute."""

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.errors import ShapeError
from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.geometry.upright import tops_seen
from models.tracks.scenes import Scene, SceneTrack
from models.tracks.trajectory import Trajectory

USUAL_STATURE_M = 1.7
_PLACES = 4000  # so many points of a long recording say where its people are


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A camera as its tracks were seen: its lens, where it truly stands, and its site.

    `recorded` is the pose before any move, `places` (N, 2) are ground points in metres where the
    scene's people are, and `span_s` is when its recording begins and ends: what stands at a site
    or wears in a clock is the same before and after a move.
    """

    intrinsics: Intrinsics
    pose: CameraPose
    recorded: CameraPose
    places: Array
    span_s: tuple[float, float]


Injector = Callable[[Sequence[SceneTrack], View, float, int], list[SceneTrack]]


def view_of(scene: Scene, pose: CameraPose | None = None) -> View:
    """The view of a scene's camera, at its true pose or at another that it was moved to.

    Raises:
        ShapeError: the scene has no track.
    """
    if not scene.tracks:
        raise ShapeError(f"scene {scene.scene_id}: at least 1 track is needed, got 0")
    recorded = scene.true_pose
    uv = np.concatenate([track.trajectory.uv for track in scene.tracks])
    uv = uv[scene.intrinsics.contains(uv)]
    uv = uv[:: max(1, len(uv) // _PLACES)]
    places, valid = ground_from_pixel(scene.intrinsics, recorded.rotation, recorded.centre_m, uv)
    return View(
        intrinsics=scene.intrinsics,
        pose=recorded if pose is None else pose,
        recorded=recorded,
        places=places[valid],
        span_s=(
            min(float(track.trajectory.time_s[0]) for track in scene.tracks),
            max(float(track.trajectory.time_s[-1]) for track in scene.tracks),
        ),
    )


def own_rng(name: str, seed: int) -> np.random.Generator:
    """Draws that belong to a name: the same whoever else is there, and wherever the camera is."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def ground_of(track: SceneTrack, view: View) -> tuple[Array, Mask]:
    """Ground points (N, 2) of a track in metres, and which are valid (N,)."""
    pose = view.pose
    return ground_from_pixel(view.intrinsics, pose.rotation, pose.centre_m, track.trajectory.uv)


def person_px(track: SceneTrack, view: View) -> Array:
    """Height (N,) in pixels of somebody of 1.7 m at each point; NaN where it is not known."""
    ground, _ = ground_of(track, view)
    tall = np.full(len(ground), USUAL_STATURE_M)
    pose = view.pose
    tops = tops_seen(view.intrinsics, pose.rotation, pose.centre_m, ground, tall)
    height = track.trajectory.uv[:, 1] - tops
    # Where the picture's border cuts the head: as at the nearest moment where it does not.
    known = np.flatnonzero(np.isfinite(height))
    if known.size:
        height = np.interp(np.arange(height.size), known, height[known])
    return np.asarray(height)


def seen_again(
    track: SceneTrack, view: View, uv: Array, top_v: Array | None, time_s: Array | None = None
) -> SceneTrack | None:
    """The track with other points, the longest run of them inside the picture; None if too short.

    Points that are not finite are taken for outside, upper edges above the picture for unknown.
    """
    inside = np.isfinite(uv).all(axis=1) & view.intrinsics.contains(uv)
    runs = np.split(np.arange(inside.size), np.flatnonzero(np.diff(inside)) + 1)
    longest = max((run for run in runs if run.size and inside[run[0]]), key=len, default=None)
    if longest is None or longest.size < 2:
        return None
    if top_v is not None:
        top_v = np.where((top_v > 1) & (top_v < uv[:, 1]), top_v, np.nan)[longest]
    times = track.trajectory.time_s if time_s is None else time_s
    return replace(track, trajectory=Trajectory(time_s=times[longest], uv=uv[longest], top_v=top_v))


def of_points(track: SceneTrack, kept: Mask) -> SceneTrack | None:
    """The track with some of its points (N,) only; None where fewer than two are left."""
    rows = np.flatnonzero(kept)
    return replace(track, trajectory=track.trajectory.part(rows)) if rows.size >= 2 else None
