"""Result of an estimate: whether the camera has moved, and its pose, with intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

from models.durations import DAY_S
from models.geometry.pose import PARAMETERS
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.verdict import Drift, DriftLimits, judge
from models.pose import AlarmRate, SecondLook, alarm_chart_result, drift_of, estimate_pose, observe
from surefoot.camera import Pose
from surefoot.site import Site
from surefoot.tracks import Track, in_order

# As the service has them unless its settings say otherwise.
_LIMITS = DriftLimits(
    sigmas=5.0, floor_rad=math.radians(1.0), floor_m=0.3, people=12, clear_ratio=0.7
)
_YEAR_S = 365.25 * DAY_S
_UNITS = {"tilt": "deg", "roll": "deg", "heading": "deg", "height": "m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The pose of tracks beside the prior pose.

    `estimated` names the numbers that the tracks determine; the others are the prior pose's.
    `sd` and `drift` (pose less prior pose) are of those.
    """

    moved: bool
    why: str
    pose: Pose
    estimated: tuple[str, ...]
    sd: dict[str, float]
    drift: dict[str, float]

    def intervals(self, level: float = 0.9) -> dict[str, tuple[float, float]]:
        """The interval of each estimated number that holds the truth with a probability.

        Raises:
            ValueError: the level is not between 0 and 1.
        """
        if not 0 < level < 1:
            raise ValueError(f"level: between 0 and 1, got {level}")
        z = NormalDist().inv_cdf((1 + level) / 2)
        values = {name: float(getattr(self.pose, name)) for name in self.estimated}
        return {
            name: (value - z * self.sd[name], value + z * self.sd[name])
            for name, value in values.items()
        }


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
    found = estimate_pose(observed, model, SecondLook(limits=_LIMITS, drifting=False))
    chart = alarm_chart_result(observed, model, _rate(ordered, alarms_a_year), first=found.first)
    earlier = None if found.earlier is None else drift_of(found.earlier, model.prior)
    verdict = judge(found.drift, _LIMITS, (), chart, earlier)
    drift = {_field(name): _in_unit(name, found.drift.of(name)[0]) for name in PARAMETERS}
    sd = {_field(name): _in_unit(name, found.drift.of(name)[1]) for name in PARAMETERS}
    estimated = tuple(_field(name) for name in found.drift.identifiable)
    return Result(
        moved=verdict.drifting,
        why=_why(found.drift, chart),
        pose=Pose.of(found.pose),
        estimated=estimated,
        sd={name: sd[name] for name in estimated},
        drift={name: drift[name] for name in estimated},
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
    parts = [
        f"{name} {_in_unit(name, drift.of(name)[0]):+.2f} {_UNITS[name]} "
        f"(sd {_in_unit(name, drift.of(name)[1]):.2f})"
        for name in drift.identifiable
    ]
    words = ", ".join(parts) if parts else "the tracks determine no number of the pose"
    if chart is not None and chart.suspicious:
        number = "times" if chart.parameter == CLOCK else PARAMETERS[chart.parameter]
        words += (
            f"; people walk as if the {number} had changed "
            f"(drift chart: {chart.statistic:.0f}, alarm at {chart.level:.0f})"
        )
    return words


def _field(name: str) -> str:
    return f"{name}_{_UNITS[name]}"


def _in_unit(name: str, value: float) -> float:
    return value if name == "height" else math.degrees(value)
