"""Reasons: a code and the numbers and names that belong to it, and no sentence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

# Radians, metres, seconds; names are those of numbers of a pose, say.
Value = float | str | Sequence[float] | Sequence[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """A reason; `values` are numbers in SI units, with the unit in their names, and names."""

    code: StrEnum
    values: Mapping[str, Value] = field(default_factory=dict)


class TracksCode(StrEnum):
    """Codes of reasons that tracks give. They are kept by clients and in stores: they stay."""

    BEYOND_LIMITS = "beyond_limits"
    SUSPECTED = "suspected"
    BEYOND_LIMITS_BEFORE = "beyond_limits_before"
    BEYOND_LIMITS_LAST_IDENTIFIABLE = "beyond_limits_last_told"
    WITHIN_LIMITS = "within_limits"
    CHART = "chart"
    SLOW_DRIFT = "slow_drift"
    SCALE_CHANGED = "scale_changed"
    LENS_CHANGED = "lens_changed"
    PATHS_CHANGED = "paths_changed"
    WAYS_CHANGED = "ways_changed"
    HEADING_AMBIGUOUS = "heading_ambiguous"
    HEADING_UNIDENTIFIABLE = "heading_untold"
    UNIDENTIFIABLE = "numbers_untold"
    TOO_FEW_GROUPS = "too_few_parties"
    SPEED_UNUSUAL = "speed_unusual"
    STATURE_UNUSUAL = "stature_unusual"
    PRIOR_POSE_DOUBTED = "prior_pose_doubted"
    PIECES = "pieces"
    SITE_CHANGED = "site_changed"
    IMAGE_SHARES = "image_shares"
    OTHER_IMAGE_SIZE = "other_image_size"
