"""Frames that are lost, and clocks that jitter or drift."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from models.geometry.rotation import Array
from models.tracks.scenes import SceneTrack
from studies.faults.view import View, of_points

_TICK_S = 1e-3  # stamps that would not increase are so far apart


def dropped_frames(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks without a share `size` of the frames: a lost frame lacks in all of them."""
    times = _frames(tracks)
    lost = times[np.random.default_rng(seed).uniform(size=times.size) < size]
    left = (of_points(track, ~np.isin(track.trajectory.time_s, lost)) for track in tracks)
    return [track for track in left if track is not None]


def jittered_clock(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks whose frames are stamped up to about `size` seconds off: one sd, each frame its own.

    Stamps still increase from frame to frame, as those of a clock that is read late do.
    """
    times = _frames(tracks)
    stamps = times + np.random.default_rng(seed).normal(0, size, times.size)
    ticks = _TICK_S * np.arange(times.size)
    stamps = np.maximum.accumulate(stamps - ticks) + ticks
    return [_stamped(track, np.interp(track.trajectory.time_s, times, stamps)) for track in tracks]


def drifting_clock(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks by a clock that is right when the recording begins and runs fast by `size` at its end.

    The rate grows evenly: of 0.05, a second lasts 1.05 at the end. Nothing is drawn.
    """
    start_s, end_s = view.span_s
    reach_s = max(end_s - start_s, 1.0)
    return [
        _stamped(
            track,
            track.trajectory.time_s
            + size * (track.trajectory.time_s - start_s) ** 2 / (2 * reach_s),
        )
        for track in tracks
    ]


def wrong_rate(
    tracks: Sequence[SceneTrack], view: View, size: float, seed: int
) -> list[SceneTrack]:
    """Tracks by a clock that is slow, or of a frame rate taken too low: times too long by `size`.

    0.2 is 30 frames a second taken for 25; too short where it is below 0. Nothing is drawn.
    """
    start_s, _ = view.span_s
    return [
        _stamped(track, start_s + (1 + size) * (track.trajectory.time_s - start_s))
        for track in tracks
    ]


def _frames(tracks: Sequence[SceneTrack]) -> Array:
    every = [track.trajectory.time_s for track in tracks]
    return np.unique(np.concatenate(every)) if every else np.empty(0)


def _stamped(track: SceneTrack, time_s: Array) -> SceneTrack:
    return replace(track, trajectory=replace(track.trajectory, time_s=time_s))
