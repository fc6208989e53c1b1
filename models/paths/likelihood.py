"""The likelihood of a pose by a site's paths: a log likelihood and its score by track.

Ours: log p(image) = log f(place, direction) + log |d(place, direction) / d(image)| - log share,
where the share is that of the map which the camera sees; a track's steps count for two at the most.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.ground import rotation_and_turns
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, Index, rotation_from_angles
from models.paths import config
from models.paths.coverage import Coverage, anchored_shares
from models.paths.density_map import PathDensityMap
from models.paths.ground_steps import place_steps
from models.paths.step_log_density import (
    Busyness,
    StepRows,
    anchored_scores_of_tracks,
    likeliest_busyness,
    likelihood_of_tracks,
    step_log_densities,
    values_of_tracks,
)
from models.tracks.observations import Observations, Steps, steps_where
from models.walking.measures import walking_groups_of

_AROUND = config.VIEW_STEP * np.concatenate([np.eye(4), -np.eye(4)])
_BUSY = np.exp(config.BUSY_LOG)
_BUSY_PRIOR = -0.5 * ((config.BUSY_LOG - config.BUSY_MEAN) / config.BUSY_SD) ** 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Walkers:
    """Steps of people who move.

    `weight` (M,) adds up to at most 2 a track; `group_idx` (tracks,) is the walking group of each
    track.
    """

    steps: Steps
    weight: Array
    group_idx: Index
    tracks: int

    @property
    def people(self) -> int:
        """The number of tracks with a step."""
        return int(np.unique(self.steps.rows.owner_idx).size)

    @property
    def walking_groups(self) -> int:
        """The number of walking groups with a step."""
        return int(np.unique(self.group_idx[np.unique(self.steps.rows.owner_idx)]).size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihood:
    """A log likelihood of all tracks, and each one's part: values (N,), scores (N, 4)."""

    value: float
    values: Array
    scores: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class PathModel:
    """The places and directions of people before a camera: what walkers are registered to.

    How busy the ground is that the reference did not see is whatever suits the tracks best: a
    camera that has turned to a square must not be pulled back for it, nor sent to an empty one.
    """

    density: PathDensityMap
    coverage: Coverage
    intrinsics: Intrinsics

    @property
    def undirected(self) -> "PathModel":
        """The places of people, whichever way they walk."""
        return replace(self, density=self.density.undirected)

    def likelihood(self, walkers: Walkers, candidate: Array) -> Likelihood:
        """The likelihood of the walkers' steps in the image, given that they are seen (4,)."""
        steps, busyness = self._rows(walkers), self._busyness()
        densities = step_log_densities(
            steps, self.density.grid, *_rotation(candidate), float(candidate[2])
        )
        around = np.array([candidate, *candidate + _AROUND])
        shares, beyonds = self.coverage.seen_from(self.intrinsics, around)
        seen, beyond = np.maximum(shares[0], config.LEAST_SEEN), float(beyonds[0])
        busy = likeliest_busyness(densities, steps, busyness, seen, beyond)
        in_all = seen + busy * beyond
        slopes = _slopes(shares[1:]) + busy * _slopes(beyonds[1:, None])
        values, scores = likelihood_of_tracks(
            densities,
            steps,
            busy * busyness.typical,
            np.log(in_all),
            np.ascontiguousarray(slopes / in_all[:, None]),
            walkers.tracks,
        )
        return Likelihood(value=float(values.sum()), values=values, scores=scores)

    def track_log_likelihoods(self, walkers: Walkers, candidates: Array) -> Array:
        """Values (K, N) of `likelihood` seen from candidates (K, 4), without scores.

        Several at once take half of the time.
        """
        return self.values_at(walkers, candidates)[0]

    def values_at(
        self, walkers: Walkers, candidates: Array, busyness: Array | None = None
    ) -> tuple[Array, Array]:
        """Values (K, N) as `track_log_likelihoods`, and the busyness (K,) of unseen ground.

        The busyness is the likeliest for these walkers, unless it is given.
        """
        levels = np.full(len(candidates), np.nan) if busyness is None else busyness
        seen, beyond = self.coverage.seen_from(self.intrinsics, candidates)
        return values_of_tracks(
            self._rows(walkers),
            self.density.grid,
            rotation_from_angles(candidates[:, 0], candidates[:, 1], candidates[:, 3]),
            np.ascontiguousarray(candidates[:, 2]),
            self._busyness(),
            np.maximum(seen, config.LEAST_SEEN),
            beyond,
            levels,
            walkers.tracks,
        )

    def scores(self, walkers: Walkers, candidates: Array, anchor: Array) -> Array:
        """Scores (..., N, 4) at candidates (..., 4) of people on ground that the reference saw.

        Which parts of the picture show that is decided at an anchor (4,), about where the
        candidates are, and stays so. Unlike the whole likelihood's, the mean of these scores is
        nothing at the truth whatever people do on other ground.
        """
        flat = candidates.reshape(-1, 4)
        shares = anchored_shares(
            self.coverage, self.density, self.intrinsics, flat[:, None] + _AROUND, anchor
        )
        turned = [_rotation(candidate) for candidate in flat]
        scores = anchored_scores_of_tracks(
            self._rows(walkers),
            self.density.grid,
            np.array([rotation for rotation, _ in turned]),
            np.array([turns for _, turns in turned]),
            np.exp(flat[:, 2]),
            rotation_from_angles(anchor[0], anchor[1], anchor[3]),
            math.exp(anchor[2]),
            np.array([_slopes(np.log(np.maximum(around, config.LEAST_SEEN))) for around in shares]),
            walkers.tracks,
        )
        return scores.reshape(*candidates.shape[:-1], walkers.tracks, 4)

    def _rows(self, walkers: Walkers) -> StepRows:
        """The steps in rows in memory, as compiled loops read them."""
        steps = walkers.steps
        return StepRows(
            starts=np.ascontiguousarray(steps.start_rays),
            ends=np.ascontiguousarray(steps.end_rays),
            weight=np.ascontiguousarray(walkers.weight),
            owner_idx=np.ascontiguousarray(steps.rows.owner_idx),
            slot_idx=self.density.slot_of(steps.rows.time_s),
        )

    def _busyness(self) -> Busyness:
        return Busyness(
            levels=_BUSY, log_prior=_BUSY_PRIOR, typical=math.exp(self.density.log_typical)
        )


def walkers_of(
    observations: Observations, candidate: Array, origin_s: float | None = None
) -> Walkers:
    """Steps that are walked, seen from a candidate (4,) that is about right.

    `origin_s` is as for `walking_groups_of`.
    """
    placed = place_steps(observations.steps, candidate)
    moving = placed.valid & (placed.length_m > config.STANDING_MPS * observations.steps.seconds)
    steps = steps_where(observations.steps, moving)
    rows = steps.rows
    way = np.stack([np.cos(placed.direction), np.sin(placed.direction)], axis=1)
    number = np.bincount(rows.owner_idx, minlength=observations.tracks)
    return Walkers(
        steps=steps,
        weight=np.minimum(1.0, config.TRACK_STEPS / number[rows.owner_idx]),
        group_idx=walking_groups_of(
            rows.time_s,
            rows.owner_idx,
            placed.place[moving],
            way[moving],
            observations.tracks,
            origin_s,
        ),
        tracks=observations.tracks,
    )


def _rotation(candidate: Array) -> tuple[Array, Array]:
    """The rotation of a candidate (4,), `camera_from_world` (3, 3), and its turns (2, 3, 3)."""
    return rotation_and_turns(*(float(candidate[number]) for number in (0, 1, 3)))


def _slopes(around: Array) -> Array:
    """The slopes (S, 4) of a share (8, S) around a candidate."""
    return np.asarray((around[:4] - around[4:]).T / (2 * config.VIEW_STEP))
