"""Report of a protocol's outcomes: by scene and estimator, and over all scenes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.protocol.cases import Outcome
from studies.slopes import slope_with_error

ENOUGH_TRACKS = 70  # slopes are of scenes with so many tracks after the knock
_ALARM_SIGMAS = 4.0
_ALARM_FLOOR = np.array([1.0, 1.0, 0.04])  # deg, deg, log height


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneFigures:
    """One estimator on one scene: medians and 90th percentiles, and shares of the cases.

    `angle_error_deg` is of the whole rotation, `tilt_roll_error_deg` of tilt and roll alone, to
    compare those that say nothing of the heading on a camera that was panned, too. `drifting` is
    the share whose drift is beyond four standard deviations and 1 deg or 4 %: on a
    still camera, false alarms. Of the heading, what those say that tell it: the median error, and
    the share of 90 % intervals that hold the truth.
    """

    scene_id: str
    estimator: str
    cases: int
    tracks: float
    angle_error_deg: float
    angle_error_p90_deg: float
    tilt_roll_error_deg: float
    height_error: float
    height_error_p90: float
    coverage: float
    degenerate: float
    drifting: float
    seconds: float
    heading_error_deg: float | None
    heading_coverage: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Overall:
    """One estimator over all scenes.

    `slope` of estimated against true drift in tilt, roll, log height, over scenes with at least 70
    tracks, each with its standard error; none where the camera is still. `coverage` is the share
    of stated 90 % intervals that hold the truth, for each of the three. The same of the heading is
    None where nothing is said of it; its slope, where the camera is not panned.
    """

    estimator: str
    cases: int
    slope: tuple[float, float, float] | None
    slope_se: tuple[float, float, float] | None
    coverage: tuple[float, float, float]
    heading_slope: float | None
    heading_slope_se: float | None
    heading_coverage: float | None


def by_scene(outcomes: Sequence[Outcome]) -> list[SceneFigures]:
    """Figures of each scene and estimator, in the order of their first outcome."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.scene_id, outcome.estimator), []).append(outcome)
    return [_figures(scene, name, group) for (scene, name), group in groups.items()]


def overall(outcomes: Sequence[Outcome]) -> list[Overall]:
    """Slopes and coverage of each estimator."""
    names = list(dict.fromkeys(outcome.estimator for outcome in outcomes))
    enough = {figures.scene_id for figures in by_scene(outcomes) if figures.tracks >= ENOUGH_TRACKS}
    found = []
    for name in names:
        own = [outcome for outcome in outcomes if outcome.estimator == name]
        big = [outcome for outcome in own if outcome.scene_id in enough]
        slope, slope_se = _slopes(big)
        heading_slope, heading_slope_se = _heading_slope(big)
        headings = [o.heading_covered for o in own if o.heading_covered is not None]
        tilt, roll, height = (float(share) for share in np.mean([o.covered for o in own], axis=0))
        found.append(
            Overall(
                estimator=name,
                cases=len(own),
                slope=slope,
                slope_se=slope_se,
                coverage=(tilt, roll, height),
                heading_slope=heading_slope,
                heading_slope_se=heading_slope_se,
                heading_coverage=float(np.mean(headings)) if headings else None,
            )
        )
    return found


def _figures(scene_id: str, estimator: str, group: Sequence[Outcome]) -> SceneFigures:
    angles = np.array([outcome.angle_error_deg for outcome in group])
    heights = np.array([outcome.height_error for outcome in group])
    drifts, sds = (np.array([getattr(o, name) for o in group]) for name in ("drift", "sd"))
    headings = [o.heading_error_deg for o in group if o.heading_error_deg is not None]
    held = [o.heading_covered for o in group if o.heading_covered is not None]
    beyond = (np.abs(drifts) > np.maximum(_ALARM_SIGMAS * sds, _ALARM_FLOOR)).any(axis=1)
    return SceneFigures(
        scene_id=scene_id,
        estimator=estimator,
        cases=len(group),
        tracks=float(np.mean([outcome.tracks for outcome in group])),
        angle_error_deg=float(np.median(angles)),
        angle_error_p90_deg=float(np.quantile(angles, 0.9)),
        tilt_roll_error_deg=float(np.median([o.tilt_roll_error_deg for o in group])),
        height_error=float(np.median(heights)),
        height_error_p90=float(np.quantile(heights, 0.9)),
        coverage=float(np.mean([outcome.covered for outcome in group])),
        degenerate=float(np.mean([outcome.degenerate for outcome in group])),
        drifting=float(beyond.mean()),
        seconds=float(np.median([outcome.seconds for outcome in group])),
        heading_error_deg=float(np.median(np.abs(headings))) if headings else None,
        heading_coverage=float(np.mean(held)) if held else None,
    )


def _slopes(
    outcomes: Sequence[Outcome],
) -> tuple[tuple[float, float, float] | None, tuple[float, float, float] | None]:
    true = np.array([outcome.true_drift for outcome in outcomes]).reshape(-1, 3)
    found = np.array([outcome.drift for outcome in outcomes]).reshape(-1, 3)
    slopes_found = [slope_with_error(true[:, number], found[:, number]) for number in range(3)]
    slopes = tuple(slope for slope, _ in slopes_found if slope is not None)
    errors = tuple(error for _, error in slopes_found if error is not None)
    if len(slopes) != 3 or len(errors) != 3:
        return None, None
    return slopes, errors


def _heading_slope(outcomes: Sequence[Outcome]) -> tuple[float | None, float | None]:
    pairs = np.array(
        [
            (o.true_heading_drift_deg, o.true_heading_drift_deg + o.heading_error_deg)
            for o in outcomes
            if o.heading_error_deg is not None
        ]
    ).reshape(-1, 2)
    return slope_with_error(pairs[:, 0], pairs[:, 1])
