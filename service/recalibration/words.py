"""The numbers of a pose as fields of JSON."""

import math

FIELDS = {"height": "height_m", "tilt": "tilt_deg", "roll": "roll_deg", "heading": "heading_deg"}


def shown(name: str, value: float) -> float:
    """A number of a pose in the unit of its field."""
    return value if name == "height" else math.degrees(value)
