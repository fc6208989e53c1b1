"""The limits from which on a drift counts, by the settings."""

import math

from models.monitoring.verdict import DriftLimits
from service.settings import Settings


def drift_limits(settings: Settings) -> DriftLimits:
    """The limits of the settings."""
    return DriftLimits(
        sigmas=settings.drift_sigmas,
        floor_rad=math.radians(settings.drift_floor_deg),
        floor_m=settings.drift_floor_m,
        people=settings.drift_people,
        clear_ratio=settings.drift_clear_ratio,
    )
