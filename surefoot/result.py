"""Result of an estimate: whether the camera has moved, and its pose, with intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from models.assessment import Assessment, AssessmentLimits, TrackWindow, assess, tracks_a_year
from models.geometry.pose import PARAMETERS
from models.geometry.rotation import Array
from models.monitoring.chart import CLOCK
from models.monitoring.drift import Drift, drift_between, served_error
from models.pose import PosePosterior
from models.reasons import TracksCode
from models.tracks.trajectory import by_end
from surefoot.camera import Pose
from surefoot.site import Site
from surefoot.tracks import Track

_CAUSES: dict[StrEnum, str] = {
    TracksCode.SCALE_CHANGED: "clock",
    TracksCode.CHART: "clock",
    TracksCode.LENS_CHANGED: "lens",
}
_UNITS = {"tilt": "deg", "roll": "deg", "heading": "deg", "height": "m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The pose of tracks beside the prior pose.

    `moved` is whether the service would raise a `drift` alert, `state` its state of the camera
    (learning, ok, suspected, unsure or drifting), `cause` is `clock` or `lens` if one of these is
    wrong instead. `probability` is that of a move by the pose alone. `estimated` names the numbers
    that the tracks determine; the others are the prior pose's. `sd` and `drift` (pose less prior
    pose) are of those. `posterior` is over what moved.
    """

    moved: bool
    state: str
    cause: str | None
    probability: float
    why: str
    pose: Pose
    estimated: tuple[str, ...]
    sd: dict[str, float]
    drift: dict[str, float]
    posterior: PosePosterior = field(repr=False, compare=False)

    def intervals(self, level: float = 0.9) -> dict[str, tuple[float, float]]:
        """The interval of each estimated number that holds the truth with a probability.

        Raises:
            ValueError: the level is not between 0 and 1.
        """
        if not 0 < level < 1:
            raise ValueError(f"level: between 0 and 1, got {level}")
        return {_field(name): self._interval(name, level) for name in parameter_names(self)}

    def _interval(self, name: str, level: float) -> tuple[float, float]:
        low, high = self.posterior.interval(name, level)
        prior = self.posterior.prior
        if name == "height":
            return prior.height_m * math.exp(low), prior.height_m * math.exp(high)
        at = math.degrees(getattr(prior, f"{name}_rad"))
        if name == "heading":  # as the pose, which is within one turn, says it
            at += 360 * round((self.pose.heading_deg - at) / 360)
        return at + math.degrees(low), at + math.degrees(high)


def served_covariance(result: Result) -> Array:
    """Covariance (4, 4) of the error of a result's pose: tilt, roll, log height, heading."""
    posterior = result.posterior
    names = parameter_names(result)
    drift = drift_between(
        posterior.parameters, posterior.sd, names, posterior.prior, posterior.move
    )
    served = result.pose.in_radians
    return served_error(drift, posterior.prior, posterior.covariance, served, moved=result.moved)


def parameter_names(result: Result) -> tuple[str, ...]:
    """Those of tilt, roll, height and heading that a result has estimated."""
    return tuple(name for name in PARAMETERS if _field(name) in result.estimated)


def estimate(site: Site, tracks: Sequence[Track], *, alarms_a_year: float = 1.0) -> Result:
    """The pose that explains tracks best, and whether it is another than the prior pose.

    Args:
        site: of the camera.
        tracks: that were seen since the site was learned, in any order; of one day or some, since
            they are taken for one window.
        alarms_a_year: how often a camera that stands may be said to have moved.

    Raises:
        TooFewTrajectoriesError: fewer than 5 people walk.
    """
    model, ordered = site.model, by_end(tracks)
    found = assess(
        TrackWindow(trajectories=ordered),
        model,
        limits=AssessmentLimits(alarms_a_year=alarms_a_year, tracks_a_year=tracks_a_year(ordered)),
    )
    drift, cause = found.drift, found.decision.cause
    known = {name: _in_unit(name, drift) for name in drift.identifiable}
    return Result(
        moved=found.decision.verdict.drifting and cause is None,
        state=str(found.state),
        cause=None if cause is None else _CAUSES[cause.code],
        probability=found.posterior.moved,
        why=_why(found),
        pose=Pose.of(found.estimated.pose),
        estimated=tuple(_field(name) for name in known),
        sd={_field(name): sd for name, (_, sd) in known.items()},
        drift={_field(name): by for name, (by, _) in known.items()},
        posterior=found.posterior,
    )


def _why(found: Assessment) -> str:
    """The drift in words: each number with its standard deviation, and the chart's result."""
    drift, chart = found.drift, found.chart
    known = {name: _in_unit(name, drift) for name in drift.identifiable}
    parts = [f"{n} {by:+.2f} {_UNITS[n]} (sd {sd:.2f})" for n, (by, sd) in known.items()]
    words = ", ".join(parts) if parts else "the tracks determine no number of the pose"
    share = min(max(drift.move.moved, 0.001), 0.999)  # nothing is ever quite sure
    words = f"moved with a probability of {share:.1%}: {words}"
    if chart is not None and chart.suspicious:
        number = "times" if chart.parameter == CLOCK else PARAMETERS[chart.parameter]
        words += (
            f"; people walk as if the {number} had changed "
            f"(drift chart: {chart.statistic:.0f}, alarm at {chart.level:.0f})"
        )
    return words


def _field(name: str) -> str:
    return f"{name}_{_UNITS[name]}"


def _in_unit(name: str, drift: Drift) -> tuple[float, float]:
    """The drift of a parameter and its standard deviation, in degrees or metres."""
    by, sd = drift.of(name)
    return (by, sd) if name == "height" else (math.degrees(by), math.degrees(sd))
