"""Segments of walks: some seconds each, as curves without their noise. Numpy only."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array
from models.simulation.walkers import Walks
from models.tracks.trajectory import Trajectory

NODES = 5
LONGEST_S = 6.0  # later on people turn, and change their pace
_SHORTEST_S = 2.4
_FEWEST_POINTS = 5
_LONGEST_GAP_S = 1.6
_DEGREE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Segments:
    """B segments: five nodes at equal times in pixels (B, 5, 2), how long they take in s (B,).

    `residual_px` (B,) is what the curve leaves over, root mean square. `owner_idx` (B,) tells whose
    a segment is: of which trajectory, or of which simulated site.
    """

    nodes_uv: Array
    duration_s: Array
    residual_px: Array
    owner_idx: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.duration_s.size)

    def take(self, indices: npt.NDArray[np.int64]) -> "Segments":
        """The segments at the given places, in that order."""
        return Segments(
            nodes_uv=self.nodes_uv[indices],
            duration_s=self.duration_s[indices],
            residual_px=self.residual_px[indices],
            owner_idx=self.owner_idx[indices],
        )


def segments_of(trajectories: Sequence[Trajectory], intrinsics: Intrinsics) -> Segments:
    """Segments of 2.4 to 6 s of trajectories, however often these are sampled.

    A trajectory is broken where it leaves the image or has a gap of more than 1.6 s; each run is
    cut into as few segments of equal length as possible, of which each needs 5 points.
    """
    nodes, durations, residuals, owners = [], [], [], []
    for owner, trajectory in enumerate(trajectories):
        for indices in _runs(trajectory, intrinsics):
            time_s, uv = trajectory.time_s[indices], trajectory.uv[indices]
            curve, left = _curve(time_s, uv)
            nodes.append(curve)
            durations.append(float(time_s[-1] - time_s[0]))
            residuals.append(left)
            owners.append(owner)
    return Segments(
        nodes_uv=np.array(nodes).reshape(-1, NODES, 2),
        duration_s=np.array(durations),
        residual_px=np.array(residuals),
        owner_idx=np.array(owners, dtype=np.int64),
    )


def segments_of_walks(walks: Walks, step_s: float) -> Segments:
    """Simulated walks as a segment each, owned by their sites."""
    nodes = np.empty((len(walks), NODES, 2))
    residual = np.empty(len(walks))
    for length in np.unique(walks.lengths):
        rows = np.flatnonzero(walks.lengths == length)
        nodes[rows], residual[rows] = _fitted(
            np.linspace(-1, 1, int(length)), walks.uv[rows, :length]
        )
    return Segments(
        nodes_uv=nodes,
        duration_s=np.asarray((walks.lengths - 1) * step_s, np.float64),
        residual_px=residual,
        owner_idx=walks.pose_idx,
    )


def _runs(trajectory: Trajectory, intrinsics: Intrinsics) -> Iterator[npt.NDArray[np.int64]]:
    """Indices of the points of each segment."""
    inside = intrinsics.contains(trajectory.uv)
    gap = np.diff(trajectory.time_s) > _LONGEST_GAP_S
    breaks = np.flatnonzero(gap | ~inside[1:] | ~inside[:-1]) + 1
    for run in np.split(np.arange(inside.size), breaks):
        time_s = trajectory.time_s[run]
        lasts_s = float(time_s[-1] - time_s[0])
        if not inside[run].all() or lasts_s < _SHORTEST_S:
            continue
        count = math.ceil(lasts_s / LONGEST_S)
        edges = np.searchsorted(time_s, time_s[0] + lasts_s / count * np.arange(1, count))
        for segment in np.split(run, edges):
            enough = segment.size >= _FEWEST_POINTS
            if enough and np.ptp(trajectory.time_s[segment]) >= _SHORTEST_S - 1e-6:
                yield segment


def _curve(time_s: Array, uv: Array) -> tuple[Array, float]:
    """Nodes (5, 2) of a curve through points (N, 2), and what it leaves over."""
    nodes, left = _fitted(2 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]) - 1, uv[None])
    return nodes[0], float(left[0])


def _fitted(times: Array, uv: Array) -> tuple[Array, Array]:
    """Nodes (B, 5, 2) of polynomials through points (B, N, 2) at times from -1 to 1."""
    degree = min(_DEGREE, times.size - 3)
    basis = np.polynomial.legendre.legvander(times, degree)
    fit = np.linalg.pinv(basis) @ uv
    nodes = np.polynomial.legendre.legvander(np.linspace(-1, 1, NODES), degree) @ fit
    return nodes, np.sqrt(np.square(uv - basis @ fit).sum(-1).mean(-1))
