"""Windows of tracks as no street has them: gaps, lengths, rates, jumps and sizes, in crowds."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from models.geometry.rotation import Array
from service.formats.track import IncomingTrack

WIDTH, HEIGHT = 1280, 720
_LONGEST_S = 6e8  # 20 years


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """So many tracks alike in kind, each of so many points over so many seconds.

    `rhythm` says how the intervals differ, `gaps` how many of them are `gap_s` longer. All begin
    within `spread_s`, at places and with velocities of so much scatter; `jump_px` is how far each
    tenth point is off. The arrays are drawn by `seed`.
    """

    tracks: int
    points: int
    seconds: float
    rhythm: str
    gaps: int
    gap_s: float
    spread_s: float
    scatter_px: float
    pace_px: float
    jump_px: float
    form: str
    seed: int


def crowds(most_points: int) -> st.SearchStrategy[Crowd]:
    """Crowds of up to so many points in all."""
    logs = st.floats(0, 1)
    made = st.builds(
        Crowd,
        tracks=st.sampled_from((1, 2, 8, 40, 150, 400, 1_000, 2_000)),
        points=st.sampled_from((5, 6, 8, 20, 60, 250, 1_000, 10_000)),
        seconds=logs.map(lambda share: 2.0 * (_LONGEST_S / 2) ** (share**2)),
        rhythm=st.sampled_from(("even", "random", "dense then sparse")),
        gaps=st.sampled_from((0, 0, 1, 3, 50)),
        gap_s=st.sampled_from((1.2, 3.4, 9.9, 60.0, 599.0)),
        spread_s=st.sampled_from((0.0, 3.0, 60.0, 3_600.0, 86_400.0)),
        scatter_px=st.sampled_from((0.0, 1.0, 30.0, 400.0)),
        pace_px=st.sampled_from((0.0, 1.0, 30.0, 3_000.0)),
        jump_px=st.sampled_from((0.0, 0.0, 40.0, 700.0)),
        form=st.sampled_from(("points", "boxes", "heads")),
        seed=st.integers(0, 2**32 - 1),
    )
    return made.filter(lambda crowd: crowd.tracks * crowd.points <= most_points)


def windows(most_points: int) -> st.SearchStrategy[tuple[list[Crowd], bool]]:
    """One to three crowds, and whether they come by the API, or were stored before its limits."""
    return st.tuples(
        st.lists(crowds(most_points), min_size=1, max_size=3), st.sampled_from((True, True, False))
    )


def tracks_of(crowd: Crowd, end_s: float, name: str) -> list[IncomingTrack]:
    """The tracks of a crowd, the last of which ends at a time; not held against any limit."""
    rng = np.random.default_rng(crowd.seed)
    begins_s = np.sort(rng.uniform(0, crowd.spread_s, crowd.tracks))
    found = [
        _track(crowd, rng, begin_s, f"{name}-{n}") for n, begin_s in enumerate(begins_s.tolist())
    ]
    late_s = max(track.points[-1, 0] for track in found)
    for track in found:
        track.points[:, 0] += end_s - late_s
    return found


def _track(crowd: Crowd, rng: np.random.Generator, begin_s: float, name: str) -> IncomingTrack:
    time_s = begin_s + _times(crowd, rng)
    start = np.array([WIDTH / 2, 0.7 * HEIGHT]) + rng.normal(0, crowd.scatter_px, 2)
    pace = rng.normal(0, crowd.pace_px, 2)
    uv = start + np.outer(time_s - begin_s, pace) + rng.normal(0, 0.5, (time_s.size, 2))
    uv[::10, 1] -= crowd.jump_px
    uv = np.clip(uv, [1.0, 90.0], [WIDTH - 1.0, HEIGHT - 3.0])
    boxes, heads = None, None
    top_v = uv[:, 1] - rng.uniform(20, 80)
    if crowd.form == "boxes":
        boxes = np.column_stack([uv[:, 0] - 15, top_v, uv[:, 0] + 15, uv[:, 1]])
    elif crowd.form == "heads":
        heads = np.column_stack([uv[:, 0], top_v])
    points = np.column_stack([time_s, uv])
    return IncomingTrack(source="t", track_id=name, points=points, boxes=boxes, heads=heads)


def _times(crowd: Crowd, rng: np.random.Generator) -> Array:
    intervals = np.ones(crowd.points - 1)
    if crowd.rhythm == "random":
        intervals = rng.exponential(1.0, intervals.size) + 1e-3
    elif crowd.rhythm == "dense then sparse":
        intervals[: intervals.size // 2] = 1e-3
    intervals *= crowd.seconds / intervals.sum()
    intervals[rng.permutation(intervals.size)[: crowd.gaps]] += crowd.gap_s
    # Microseconds: epoch seconds are told apart no finer.
    return np.concatenate([[0.0], np.cumsum(np.maximum(intervals, 1e-5))])
