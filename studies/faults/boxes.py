"""Detectors whose boxes jitter, are rounded, or sit otherwise after an update."""

from collections.abc import Sequence

import numpy as np

from models.geometry.rotation import Array
from models.tracks.scenes import SceneTrack
from studies.faults.view import View, own_rng, person_px, seen_again


def box_jitter(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks whose boxes' edges move by a share `size` of a person's height: one sd, each frame.

    The foot across and down, and the upper edge, each for itself.
    """
    found = []
    for track in tracks:
        own, rng = track.trajectory, own_rng(track.track_id, seed)
        sd = size * np.nan_to_num(person_px(track, view))
        uv = _clamped(own.uv + rng.normal(size=own.uv.shape) * sd[:, None], view)
        noise = rng.normal(size=sd.size) * sd
        found.append(seen_again(track, view, uv, None if own.top_v is None else own.top_v + noise))
    return [track for track in found if track is not None]


def rounding(tracks: Sequence[SceneTrack], view: View, size: float, seed: int) -> list[SceneTrack]:
    """Tracks in whole multiples of `size` pixels, as of a smaller picture. Nothing is drawn."""
    found = []
    for track in tracks:
        own = track.trajectory
        uv, top_v = _clamped(np.rint(own.uv / size) * size, view), own.top_v
        found.append(
            seen_again(track, view, uv, None if top_v is None else np.rint(top_v / size) * size)
        )
    return [track for track in found if track is not None]


def detector_update(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks of a detector whose boxes reach farther: by a share `size` of a person's height.

    So much below the feet and above the head; tighter where `size` is below 0. Nothing is drawn.
    """
    found = []
    for track in tracks:
        own = track.trajectory
        by = size * np.nan_to_num(person_px(track, view))
        uv = _clamped(own.uv + np.stack([np.zeros_like(by), by], axis=1), view)
        found.append(seen_again(track, view, uv, None if own.top_v is None else own.top_v - by))
    return [track for track in found if track is not None]


def _clamped(uv: Array, view: View) -> Array:
    """Pixels (N, 2) inside the picture: detectors end their boxes at its border."""
    lens = view.intrinsics
    return np.asarray(np.clip(uv, -0.5, (lens.width - 0.5, lens.height - 0.5)))
