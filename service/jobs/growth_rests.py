"""Flow maps whose growth has failed in this worker: they are left alone for an hour."""

import time

from service.reasons import Reasons

_REST_S = 3600.0


class GrowthRests:
    """Which cameras' maps rest, until when, and why."""

    def __init__(self) -> None:
        self._rests: dict[str, tuple[float, Reasons]] = {}

    def begin(self, camera_id: str, why: Reasons) -> None:
        """Leave a camera's map as it is for an hour."""
        self._rests[camera_id] = (time.monotonic() + _REST_S, why)

    def lacks_of(self, camera_id: str) -> Reasons:
        """Why a camera's map rests; nothing where it does not."""
        until_s, why = self._rests.get(camera_id, (0.0, ()))
        if time.monotonic() < until_s:
            return why
        self._rests.pop(camera_id, None)
        return ()
