"""What is usual of heads at a site, learned while its pose is known, and how they err there.

Ours: heads whose leans follow the picture's columns more than the verticals were never seen apart
from the feet, and are not used.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.rotation import Array
from models.tracks.head_foot import Uprights
from models.walking.heads.fitting import (
    ASSUMED_SPREAD,
    LeanSpread,
    column_share,
    fit_angles,
    learn_habit,
)
from models.walking.mixed_model import Normal
from models.walking.variance_inflation import (
    Tracks,
    shrink_offset,
    squared_ratio,
    variance_inflation,
)

FEWEST_TRACKS = 12
_PLAUSIBLE_OFFSET = np.radians([0.5, 0.5])
_ASSUMED_INFLATION = 1.5
_SPREAD_ROUNDS = 12
_MOST_COLUMN_SHARE = 0.3  # beyond doubt: more would make a knock seem smaller by as much


@dataclass(frozen=True, slots=True, kw_only=True)
class VerticalReference:
    """How people's heads stand over their feet at a site.

    `at` (2,) is the tilt and roll that it was learned at. `habit` is what is usual: the bias to the
    right, and the lean of who walks to the right (2,), in radians. `column_share` is how far the
    heads follow the picture's columns: 0 where each was measured, 1 where all are right above their
    feet in the picture, with standard deviation `column_share_sd`. `offset` (2,) with
    `offset_covariance` (2, 2) is what the estimate says of tilt and roll beyond the truth; its
    variances are to be multiplied by `variance_inflation`. `information_of_a_track` (2, 2) is what
    one track told, `tracks` how many had heads. Of heads that are not `leaning` only the share
    is said.
    """

    at: Array
    habit: Normal
    spread: LeanSpread
    column_share: float
    column_share_sd: float
    offset: Array
    offset_covariance: Array
    variance_inflation: float
    information_of_a_track: Array
    tracks: int

    @property
    def leaning(self) -> bool:
        """Whether heads were seen to lean as verticals do, and not as columns."""
        return abs(self.column_share) + 2 * self.column_share_sd < _MOST_COLUMN_SHARE


def learn_verticals(uprights: Uprights | None, at: Array) -> VerticalReference | None:
    """What is usual of the heads of a camera at a known tilt and roll (2,).

    None where fewer than 12 tracks have heads. In the order of time: by parts of it comes how far
    errors are larger than they seem.
    """
    if uprights is None or uprights.tracks.size < FEWEST_TRACKS:
        return None
    tracks = uprights.tracks
    habit, spread = learn_habit(uprights, at, ASSUMED_SPREAD, rounds=_SPREAD_ROUNDS)
    share, share_sd = column_share(uprights, at, spread)
    found = VerticalReference(
        at=at,
        habit=habit,
        spread=spread,
        column_share=share,
        column_share_sd=share_sd,
        offset=np.zeros(2),
        offset_covariance=np.zeros((2, 2)),
        variance_inflation=1.0,
        information_of_a_track=np.zeros((2, 2)),
        tracks=int(tracks.size),
    )
    if not found.leaning:
        return found
    whole = fit_angles(uprights, at, habit, spread)
    offset = whole.mean - at

    def error_ratio(train: Tracks, test: Tracks) -> float:
        usual, _ = learn_habit(uprights.of_tracks(train), at, spread, rounds=0)
        fit = fit_angles(uprights.of_tracks(test), at, usual, spread)
        return squared_ratio(fit.mean - at - offset, fit.covariance)

    inflation = variance_inflation(tracks, error_ratio, _ASSUMED_INFLATION)
    noise = whole.covariance * inflation
    kept, left = shrink_offset(offset, noise, _PLAUSIBLE_OFFSET)
    return replace(
        found,
        column_share_sd=share_sd * float(np.sqrt(inflation)),
        offset=kept,
        offset_covariance=(left + left.T) / 2,
        variance_inflation=inflation,
        information_of_a_track=np.linalg.inv(noise) / tracks.size,
    )
