"""What moves like a walker, what stands, what rides, and what is none of these."""

from enum import StrEnum

import numpy as np
import numpy.typing as npt

from models.estimation.joint.measures import measure_speeds
from models.estimation.joint.observations import Observations
from models.estimation.parameters import plane_parameters_of
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array, Mask
from models.people.usual import residuals

_SLOW = float(np.log(0.4))  # of the usual pace there: a foot that shifts, no walk
_STANDING = 0.75  # of the steps
_FAST = float(np.log(2.5))  # five times what people differ by: few run as fast
_FAST_MPS = 2.3  # at a height that is right to a third; where most amble, walkers are no riders
_STEADY = float(np.log(1.8))  # what rides is fast for three quarters of its way
_ERRATIC = 0.6  # of a log: half of the steps are further apart than any walker's


class Kind(StrEnum):
    """What a track is of; `UNSEEN` has no step that tells it."""

    WALKER = "walker"
    STANDING = "standing"
    WHEELS = "wheels"
    OTHER = "other"
    UNSEEN = "unseen"


KINDS = tuple(Kind)
# Whose steps and boxes count. How fast somebody is who stands is no walker's pace, which the
# likelihood knows of each step; how tall they are is as good as anybody's.
ASKED = (Kind.WALKER, Kind.STANDING, Kind.UNSEEN)


def kinds_of(observations: Observations, pose: CameraPose) -> npt.NDArray[np.int64]:
    """The place in `KINDS` (tracks,) of each track, by its steps.

    A pace is held against what is usual at the same place of the picture in the same direction:
    fast everywhere and all the time is a bicycle, a runner or a car; fast now and then a tracker's
    mistake. At a pose that is off, everybody is off alike.
    """
    speeds = measure_speeds(observations.steps, plane_parameters_of(pose), pose.heading_rad)
    assert speeds.direction is not None
    steps, rows = observations.steps, speeds.rows
    seen = speeds.valid
    rays = (steps.start_rays[seen, :2] + steps.end_rays[seen, :2]) / 2
    away = (
        speeds.place[seen] / np.maximum(np.linalg.norm(speeds.place[seen], axis=1), 1e-9)[:, None]
    )
    way = speeds.direction[seen]
    along, aside = (away * way).sum(axis=1), away[:, 0] * way[:, 1] - away[:, 1] * way[:, 0]
    beside = np.stack([2 * along**2 - 1, 2 * along * aside], axis=1)
    owner_idx = rows.owner_idx[seen]
    value = speeds.value[seen]
    off = residuals(rays, beside, value, owner_idx)
    return _sorted(off, value, owner_idx, observations.tracks)


def _sorted(
    off: Array, value: Array, owner_idx: npt.NDArray[np.int64], tracks: int
) -> npt.NDArray[np.int64]:
    number = np.bincount(owner_idx, minlength=tracks)
    stood = np.bincount(owner_idx, off < _SLOW, tracks)
    walked = off >= _SLOW
    low, middle, high = (
        _quantiles(off[walked], owner_idx[walked], tracks, share) for share in (0.25, 0.5, 0.75)
    )
    found = np.full(tracks, KINDS.index(Kind.WALKER))

    def name(kind: Kind, those: Mask) -> None:
        found[those] = KINDS.index(kind)

    pace = _quantiles(value[walked], owner_idx[walked], tracks, 0.5)
    fast = (middle > _FAST) & (pace > np.log(_FAST_MPS))
    name(Kind.OTHER, (high - low > _ERRATIC) | fast)
    name(Kind.WHEELS, fast & (low > _STEADY))
    name(Kind.STANDING, stood > _STANDING * number)
    name(Kind.UNSEEN, number == 0)
    return found


def _quantiles(values: Array, owner_idx: npt.NDArray[np.int64], tracks: int, share: float) -> Array:
    """A quantile (tracks,) of the values of each track; 0 of none."""
    order = np.lexsort((values, owner_idx))
    number = np.bincount(owner_idx, minlength=tracks)
    first = np.cumsum(number) - number
    at = share * np.maximum(number - 1, 0)
    below = np.minimum(first + np.floor(at).astype(np.int64), max(values.size - 1, 0))
    above = np.minimum(first + np.ceil(at).astype(np.int64), max(values.size - 1, 0))
    if not values.size:
        return np.zeros(tracks)
    ranked = values[order]
    part = at - np.floor(at)
    return np.where(number > 0, (1 - part) * ranked[below] + part * ranked[above], 0.0)
