"""The verdict, by the chart at once and by what surely moved, with hysteresis; and its reasons."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from models.durations import DAY_S
from models.geometry.pose import ANGLES, PARAMETERS, PLANE_PARAMETERS, CameraPose, PoseParameters
from models.geometry.rotation import angle_between
from models.monitoring import config
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.creep import Creep
from models.reasons import Reason, TracksCode, Value

LIKELY = 0.5  # likelier than not
# What a clock that is wrong looks like in a pose is a height.
_CHARTED = (*PARAMETERS, "height")


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveProbabilities:
    """How likely a camera has moved, and changed each of its parameters by that."""

    moved: float
    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Pose minus prior pose: `by` how much, and its standard deviations.

    `identifiable` names the parameters that the tracks determine; the others stand here but count
    nowhere. `angle_rad` is the whole rotation that the identifiable angles make. `move` is how
    likely one is.
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

        The floor of an angle is one of the whole turn: 0.8 deg in each of three angles are 1.3 deg.
        The largest of the angles counts for all of them.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftVerdict:
    """`streak` is 1 where the window is beyond the limits, -1 where it is below `clear_ratio`.

    `excess` is the largest identifiable drift in units of its limit: 1 and more is beyond.
    `drifted` names the parameters that have been beyond since the drift began; empty where there is
    none. `alarmed` says that the chart, which the pose bears out, or the creep is beyond its level.
    """

    streak: int
    excess: float
    drifted: tuple[str, ...]
    alarmed: bool = False

    @property
    def drifting(self) -> bool:
        """True while the camera counts as moved."""
        return bool(self.drifted)


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


def judge(
    drift: Drift,
    limits: DriftLimits,
    drifted: tuple[str, ...],
    chart: ChartResult | None = None,
    creep: Creep | None = None,
    *,
    enough: bool = True,
    scaled: bool = False,
) -> DriftVerdict:
    """The verdict on a window, given what had drifted before.

    Drifting begins at once where the creep is beyond its level, or the chart is and the pose of
    the tracks that it is of bears it out, and where it is certain that the camera moved, and by
    more than the floor. It ends where a move is unlikely, or all are below `clear_ratio`, and the
    chart and the creep are calm. A parameter that is not identifiable is never beyond, and its
    drift does not end until it is identifiable again or the chart, which asks for all four, is
    calm. Where nothing is identifiable, nothing changes.

    Of fewer than `enough` people since somebody said how the camera stands, the pose neither begins
    nor ends a drift. A clock or a lens that is wrong before a camera that stands is one in height,
    what is seen being `scaled`.
    """
    crept = () if creep is None or not creep.moved else (PARAMETERS[creep.parameter],)
    if not crept and scaled and enough:
        crept = ("height",)
    beyond = _beyond(drift, limits) if enough else {}
    if not drift.identifiable and chart is None and not crept and not beyond:
        return DriftVerdict(streak=0, excess=0.0, drifted=drifted)
    charted = chart is not None and chart.moved and _bears_out(drift, limits)
    alarmed = (_CHARTED[chart.parameter],) if chart is not None and charted else crept
    calm = all(each is None or each.excess < limits.clear_ratio for each in (chart, creep))
    known = set(drift.identifiable) if chart is None else set(PARAMETERS)
    well = enough and calm and set(drifted) <= known and _is_well(drift, limits)
    streak = 1 if beyond or alarmed else -1 if well else 0
    if not drifted:
        drifted = tuple(beyond) or alarmed
    elif streak < 0:
        drifted = ()
    else:
        drifted = tuple(name for name in PARAMETERS if name in drifted or name in beyond)
    return DriftVerdict(
        streak=streak,
        excess=max(beyond.values(), default=0.0),
        drifted=drifted,
        alarmed=bool(alarmed),
    )


def may_be_told(moved: float, limits: DriftLimits, creep: Creep | None, *, told: bool) -> bool:
    """False where `judge` can tell no drift, whatever else it is given; `told` one before."""
    crept = creep is not None and creep.moved
    return told or crept or moved >= min(config.BORNE_OUT, limits.certainty)


def _bears_out(drift: Drift, limits: DriftLimits) -> bool:
    """True where a pose bears an alarm of the chart out.

    A height within its floor alone does not: people who hurry for an hour look like one.
    """
    angle = max(drift.move.parameters[name] for name in ANGLES)
    other = angle >= LIKELY or drift.ratio("height", limits) >= 1
    return drift.move.moved >= config.BORNE_OUT and other


def _beyond(drift: Drift, limits: DriftLimits) -> dict[str, float]:
    """The parameters that likelier moved than not, beyond their floors, in units of these.

    Of a camera that certainly moved. A heading may be one of them though nobody can tell how far:
    it counts as just beyond.
    """
    moved = drift.move
    if moved.moved < limits.certainty:
        return {}
    ratios = drift.ratios(limits)
    if "heading" not in ratios:
        ratios["heading"] = min(drift.ratio("heading", limits), 1.0)
    return {n: r for n, r in ratios.items() if r >= 1 and moved.parameters[n] >= LIKELY}


def _is_well(drift: Drift, limits: DriftLimits) -> bool:
    largest = max(drift.ratios(limits).values(), default=0.0)
    return drift.move.moved < LIKELY or largest < limits.clear_ratio


def reason_of_drift(drift: Drift, verdict: DriftVerdict, limits: DriftLimits) -> Reason | None:
    """The identifiable parameters against the prior pose and the limits; None where none is."""
    values: dict[str, Value] = {
        "moved": drift.move.moved,
        "certainty": limits.certainty,
        "floor_rad": limits.floor_rad,
        "floor_m": limits.floor_m,
    }
    if not drift.identifiable and verdict.excess < 1:
        code = TracksCode.BEYOND_LIMITS_LAST_IDENTIFIABLE
        return Reason(code=code, values=values) if verdict.drifting else None
    for name in drift.identifiable:
        unit = "m" if name == "height" else "rad"
        values[f"{name}_{unit}"], values[f"{name}_sd_{unit}"] = drift.of(name)
    if verdict.drifting:
        beyond = verdict.excess >= 1
        code = TracksCode.BEYOND_LIMITS if beyond else TracksCode.BEYOND_LIMITS_BEFORE
    else:
        code = TracksCode.SUSPECTED if drift.move.moved >= LIKELY else TracksCode.WITHIN_LIMITS
    return Reason(code=code, values=values)


def reason_of_chart(chart: ChartResult) -> Reason | None:
    """Direction in which the drift chart takes the camera to have moved; None where it is calm.

    Its `number` is a parameter of a pose, or `times` where all were too long (`sign` 1) or too
    short (-1).
    """
    if not chart.suspicious:
        return None
    parameter = "times" if chart.parameter == CLOCK else PARAMETERS[chart.parameter]
    values: dict[str, Value] = {
        "number": parameter,
        "sign": chart.sign,
        "parties": chart.walking_groups,
        "statistic": chart.statistic,
        "level": chart.level,
    }
    return Reason(code=TracksCode.CHART, values=values)


def reason_of_creep(creep: Creep) -> Reason | None:
    """Direction, size and beginning of a camera's creep; None where it has not crept.

    `since` is a time, as of `datetime.isoformat`.
    """
    if not creep.moved:
        return None
    values: dict[str, Value] = {
        "number": PARAMETERS[creep.parameter],
        "by_rad": creep.by,
        "sd_rad": creep.sd,
        "since": datetime.fromtimestamp(creep.since_day * DAY_S, UTC).isoformat(),
        "statistic": creep.statistic,
        "level": creep.level,
    }
    return Reason(code=TracksCode.CREPT, values=values)


def may_be_clock(chart: ChartResult) -> bool:
    """True where an alarm may be of the clock, after too few walking groups for the pose to decide.

    An alarm about a scale that waits for a few more people can be called what it is.
    """
    return (
        chart.parameter in (PARAMETERS.index("height"), CLOCK)
        and chart.walking_groups < config.GROUPS_FOR_POSE
    )


def charted_clock(chart: ChartResult, turned: float) -> Reason | None:
    """Reason of an alarm about times; None of one about the pose, or where an angle changed.

    `turned` is the probability that one did, given that the camera moved.
    """
    if chart.parameter != CLOCK or turned > config.CLOCK_TURNED:
        return None
    return reason_of_chart(chart)


def clock_fault(
    drift: Drift, turned: float, prior: CameraPose, frame_rate_hz: float | None
) -> Reason | None:
    """Reason of a change of scale with unchanged angles; None where there is none.

    Times that are too long by a factor make people slow, and only a higher camera makes them walk
    as before: the height grows by that factor and nothing else does. A camera that was raised
    without turning looks the same; one that may have turned has a clock that is right.

    `turned` is how likely an angle changed, given a move; where nobody says `frame_rate_hz` it is
    25.
    """
    if not set(PLANE_PARAMETERS) <= set(drift.identifiable):
        return None
    factor = 1 + drift.by.height_m / prior.height_m
    changed = drift.move.moved >= LIKELY and drift.move.parameters["height"] >= LIKELY
    if not changed or turned > config.CLOCK_TURNED:
        return None
    return reason_of_scale(factor, frame_rate_hz)


def reason_of_scale(factor: float, frame_rate_hz: float | None) -> Reason | None:
    """Reason of times that are too long by a factor; None where it is a habit of the hour."""
    if abs(math.log(factor)) <= config.CLOCK_LEAST_LOG:
        return None
    values = {"factor": factor, "rate_hz": frame_rate_hz or config.USUAL_RATE_HZ}
    return Reason(code=TracksCode.SCALE_CHANGED, values=values)
