"""What many served outcomes come to: errors, coverage, slopes, by whatever they are grouped."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.evaluation.served.outcomes import NUMBERS, NumberOutcome, ServedOutcome

FARTHEST_SD = 5.0  # no error should be beyond it


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberFigures:
    """One number over some cases: degrees, or the log of the height.

    `told` is the share of cases that tell it; the others are of those. The median and the 90th
    percentile of the error, the share of 90 % intervals that hold the truth, the largest error in
    standard deviations, the slope of estimated against true drift with its standard error, where
    it was moved. None where there is nothing to tell it by.
    """

    told: float
    error: float | None
    error_p90: float | None
    covered: float | None
    worst_sd: float | None
    slope: float | None
    slope_se: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Some cases: `rotation_deg` and `height_error` are of the served pose, medians and p90.

    `beyond` counts cases with a told number more than 5 standard deviations off, `sound` is the
    share of numbers that are covered or declared, `cut` the share of cases with a window that was
    cut though nothing moved, `failed` of those in which nothing was told at all.
    """

    cases: int
    reference_tracks: float
    seen_tracks: float
    rotation_deg: float
    rotation_p90_deg: float
    height_error: float
    height_error_p90: float
    numbers: tuple[NumberFigures, ...]
    beyond: int
    sound: float
    cut: float
    mapped: float
    failed: float


def figures_of(outcomes: Sequence[ServedOutcome]) -> Figures:
    """The figures of at least one outcome."""
    told = [outcome for outcome in outcomes if outcome.numbers]
    columns = [[outcome.numbers[place] for outcome in told] for place in range(len(NUMBERS))]
    every = [number for outcome in told for number in outcome.numbers]
    rotation = np.array([outcome.rotation_deg for outcome in outcomes])
    height = np.array([outcome.height_error for outcome in outcomes])
    worst = [max((n.off_sd for n in o.numbers if n.told), default=0.0) for o in told]
    return Figures(
        cases=len(outcomes),
        reference_tracks=float(np.mean([outcome.reference_tracks for outcome in outcomes])),
        seen_tracks=float(np.mean([outcome.seen_tracks for outcome in outcomes])),
        rotation_deg=float(np.median(rotation)),
        rotation_p90_deg=float(np.quantile(rotation, 0.9)),
        height_error=float(np.median(height)),
        height_error_p90=float(np.quantile(height, 0.9)),
        numbers=tuple(_number(column, len(outcomes)) for column in columns),
        beyond=sum(off > FARTHEST_SD for off in worst),
        sound=float(np.mean([n.covered or not n.told for n in every])) if every else 1.0,
        cut=float(np.mean([outcome.cuts > 0 for outcome in outcomes])),
        mapped=float(np.mean([outcome.mapped for outcome in outcomes])),
        failed=float(np.mean([not outcome.numbers for outcome in outcomes])),
    )


def _number(column: Sequence[NumberOutcome], cases: int) -> NumberFigures:
    own = [number for number in column if number.told]
    errors = np.abs([number.error for number in own])
    slope, slope_se = _slope(own)
    return NumberFigures(
        told=len(own) / cases,
        error=float(np.median(errors)) if own else None,
        error_p90=float(np.quantile(errors, 0.9)) if own else None,
        covered=float(np.mean([number.covered for number in own])) if own else None,
        worst_sd=max(number.off_sd for number in own) if own else None,
        slope=slope,
        slope_se=slope_se,
    )


def _slope(numbers: Sequence[NumberOutcome]) -> tuple[float | None, float | None]:
    """Least squares' slope of told against true moves with an intercept, and its standard error."""
    true = np.array([number.moved for number in numbers])
    told = true + np.array([number.error for number in numbers])
    if len(true) < 3 or not np.ptp(true) > 1e-9:
        return None, None
    centred = true - true.mean()
    power = float(centred @ centred)
    slope = float(centred @ told) / power
    residual = told - told.mean() - slope * centred
    return slope, float(np.sqrt(residual @ residual / max(len(true) - 2, 1) / power))
