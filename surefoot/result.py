"""Result of an estimate: whether the camera has moved, and its pose, with intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from models.durations import DAY_S
from models.errors import TooFewTrajectoriesError
from models.geometry.pose import PARAMETERS
from models.geometry.rotation import Array
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.verdict import Drift, DriftLimits, drift_between, judge, served_error
from models.pose import (
    AlarmRate,
    PosePosterior,
    alarm_chart_result,
    estimate_pose,
    observe,
    since_alarm,
)
from models.walking.config import FEWEST_WALKERS
from surefoot.camera import Pose
from surefoot.site import Site
from surefoot.tracks import Track, in_order

_LIMITS = DriftLimits()
_YEAR_S = 365.25 * DAY_S
_UNITS = {"tilt": "deg", "roll": "deg", "heading": "deg", "height": "m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The pose of tracks beside the prior pose.

    `moved` is what an alert would say, `probability` how likely it is by the pose alone.
    `estimated` names the numbers that the tracks determine; the others are the prior pose's.
    `sd` and `drift` (pose less prior pose) are of those. `posterior` is over what moved.
    """

    moved: bool
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
    model, ordered = site.model, in_order(tracks)
    observed = observe(ordered, model.intrinsics, model.prior)
    if observed.walkers < FEWEST_WALKERS:
        raise TooFewTrajectoriesError(
            f"tracks: at least {FEWEST_WALKERS} people who walk are needed, got {observed.walkers}"
        )
    found = estimate_pose(observed, model)
    chart = alarm_chart_result(observed, model, _rate(ordered, alarms_a_year), first=found.first)
    found = since_alarm(found, observed, model, chart)
    verdict = judge(found.drift, _LIMITS, (), chart)
    known = {name: _in_unit(name, found.drift) for name in found.drift.identifiable}
    return Result(
        moved=verdict.drifting,
        probability=found.posterior.moved,
        why=_why(found.drift, chart),
        pose=Pose.of(found.pose),
        estimated=tuple(_field(name) for name in known),
        sd={_field(name): sd for name, (_, sd) in known.items()},
        drift={_field(name): by for name, (by, _) in known.items()},
        posterior=found.posterior,
    )


def _rate(tracks: Sequence[Track], alarms_a_year: float) -> AlarmRate:
    """The rate of false alarms, for people who come as often as these did."""
    span_s = max(float(tracks[-1].time_s[-1] - tracks[0].time_s[-1]), 1.0) if tracks else 1.0
    return AlarmRate(
        alarms_a_year=alarms_a_year,
        tracks_a_year=max(len(tracks), 1) * _YEAR_S / span_s,
        calm_ratio=_LIMITS.clear_ratio,
        calm_groups=_LIMITS.people,
    )


def _why(drift: Drift, chart: ChartResult | None) -> str:
    """The drift in words: each number with its standard deviation, and what the chart says."""
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
