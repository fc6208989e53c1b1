"""Drift from the prior pose with its probabilities, and the limits from which it counts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import (
    ANGLES,
    PARAMETERS,
    CameraPose,
    PoseParameters,
    array_of,
    parameters_apart,
)
from models.geometry.rotation import Array, angle_between

LIKELY = 0.5  # likelier than not
_LOWEST = 0.01  # of the prior pose's height


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveProbabilities:
    """How likely a camera has moved, and changed each of its parameters by that."""

    moved: float
    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Pose minus prior pose: `by` how much, and its standard deviations.

    `identifiable` names the parameters that the tracks determine; the others are not used.
    `angle_rad` is the whole rotation that the identifiable angles make. `move` is how likely one
    is.
    """

    by: PoseParameters
    sd: PoseParameters
    angle_rad: float
    identifiable: tuple[str, ...]
    move: MoveProbabilities

    def of(self, name: str) -> tuple[float, float]:
        """A parameter's drift and its standard deviation: in metres for height, else in radians."""
        return self.by.of(name), self.sd.of(name)

    def ratio(self, name: str, limits: "DriftLimits") -> float:
        """A parameter's drift in units of its floor."""
        return abs(self.by.of(name)) / max(limits.floor(name), 1e-12)

    def ratios(self, limits: "DriftLimits") -> dict[str, float]:
        """The drift of each identifiable parameter in units of its floor.

        The floor of an angle applies to the whole turn: 0.8 deg in each of three angles are
        1.3 deg. The largest angle counts for all three.
        """
        found = {name: self.ratio(name, limits) for name in self.identifiable}
        angles = [name for name in ANGLES if name in found]
        if angles:
            largest = max(angles, key=lambda name: found[name])
            turned = self.angle_rad / max(limits.floor_rad, 1e-12)
            found[largest] = max(found[largest], turned)
        return found

    @property
    def has_angle(self) -> bool:
        """True where an angle is identifiable."""
        return bool(set(ANGLES) & set(self.identifiable))


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftLimits:
    """Limits of a drift: how certain a move has to be, and floors of its size.

    A drift ends below `clear_ratio` of the floor. Once a person has said how the camera stands, so
    many `people` have to come before anything else is said. The defaults are those of the service's
    settings.
    """

    certainty: float = 0.99
    floor_rad: float = math.radians(1.0)
    floor_m: float = 0.3
    people: int = 12
    clear_ratio: float = 0.7

    def floor(self, name: str) -> float:
        """The least drift of a parameter that counts: metres, or radians."""
        return self.floor_m if name == "height" else self.floor_rad


def drift_between(
    found: PoseParameters,
    sd: PoseParameters,
    identifiable: Sequence[str],
    prior: CameraPose,
    move: MoveProbabilities,
) -> Drift:
    """Drift: pose less prior pose; x and y count as unmoved."""
    drift = Drift(
        by=PoseParameters(
            height_m=found.height_m - prior.height_m,
            tilt_rad=min(max(found.tilt_rad, -math.pi / 2), math.pi / 2) - prior.tilt_rad,
            roll_rad=math.remainder(found.roll_rad - prior.roll_rad, 2 * math.pi),
            heading_rad=math.remainder(found.heading_rad - prior.heading_rad, 2 * math.pi),
        ),
        sd=sd,
        angle_rad=0.0,
        identifiable=tuple(name for name in PARAMETERS if name in identifiable),
        move=move,
    )
    turned = pose_after(drift, prior)
    return replace(
        drift, angle_rad=float(angle_between(turned.quaternion_wxyz, prior.quaternion_wxyz))
    )


def pose_after(drift: Drift, prior: CameraPose) -> CameraPose:
    """The prior pose moved by the identifiable drift; the rest stays the prior's."""
    turn = 2 * math.pi
    by = {name: drift.by.of(name) if name in drift.identifiable else 0.0 for name in PARAMETERS}
    heading = prior.heading_rad + by["heading"]
    return replace(
        prior,
        height_m=prior.height_m + by["height"],
        tilt_rad=prior.tilt_rad + by["tilt"],
        roll_rad=prior.roll_rad + by["roll"],
        # Within one turn, as a prior pose has to be.
        heading_rad=heading if abs(heading) <= turn else math.fmod(heading, turn),
    )


def served_error(
    drift: Drift, prior: CameraPose, covariance: Array, served: CameraPose, *, moved: bool
) -> Array:
    """Second moments (4, 4) of the error of a served pose, in `PARAMETERS`.

    A parameter that the tracks do not determine has its prior value in the served pose. If the
    camera has moved, the parameter may have changed too, and its error is as large as the posterior
    allows. If no move is known, that variance counts by the probability of a change.

    Args:
        drift: of the posterior; its `by` has all parameters.
        prior: the prior pose.
        covariance: (4, 4) of the posterior around its mean.
        served: the served pose.
        moved: whether the camera counts as moved.
    """
    determined = np.isin(PARAMETERS, drift.identifiable)
    chance = [drift.move.parameters.get(name, 0.0) for name in PARAMETERS]
    scale = np.sqrt(np.where(determined | moved, 1.0, chance))
    mean = array_of(prior) + [drift.by.of(name) for name in PARAMETERS]
    height = PARAMETERS.index("height")
    mean[height] = math.log(max(prior.height_m + drift.by.height_m, _LOWEST * prior.height_m))
    missed = parameters_apart(mean, array_of(served))
    return np.asarray(scale[:, None] * covariance * scale + np.outer(missed, missed))
