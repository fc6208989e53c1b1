"""Limits on the growth of flow maps: not soon after a failure, nor at estimates' expense."""

import time

from models.durations import HOUR_S
from service.reasons import Reasons

_SHARE = 0.1  # of a worker's time, where estimates wait for it


class GrowthCooldown:
    """Cameras whose maps do not grow for a while, and why."""

    def __init__(self) -> None:
        self._rests: dict[str, tuple[float, Reasons]] = {}

    def begin(self, camera_id: str, why: Reasons) -> None:
        """Leave a camera's map as it is for an hour."""
        self._rests[camera_id] = (time.monotonic() + HOUR_S, why)

    def failures_of(self, camera_id: str) -> Reasons:
        """The failures for which a camera's map cools down; none where it does not."""
        until_s, why = self._rests.get(camera_id, (0.0, ()))
        if time.monotonic() < until_s:
            return why
        self._rests.pop(camera_id, None)
        return ()


class GrowthBudget:
    """The time that a worker may spend on growth: of hundreds of maps some are always due.

    Where estimates wait, no more than a tenth of it: a map that grows an hour later is no worse.
    """

    def __init__(self) -> None:
        self._free_s = 0.0

    @property
    def spent(self) -> bool:
        """True where so much of the time was spent that estimates go first."""
        return time.monotonic() < self._free_s

    def spend(self, seconds: float) -> None:
        """Note how long a growth took."""
        now_s = time.monotonic()
        self._free_s = max(self._free_s, now_s) + seconds * (1 / _SHARE - 1)
