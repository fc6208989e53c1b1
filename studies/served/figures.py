"""Figures of many served outcomes: errors, coverage, slopes, by whatever they are grouped."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.pose import PARAMETERS
from studies.served.outcomes import ParameterOutcome, ServedOutcome
from studies.slopes import slope_with_error

FARTHEST_SD = 5.0  # no error should be beyond it


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterFigures:
    """One parameter over some cases: degrees, or the log of the height.

    `identifiable` is the share of cases that determine it; the others are of those. The median and
    the 90th percentile of the error, the share of 90 % intervals that hold the truth, the largest
    error in standard deviations, the slope of known against true drift with its standard error,
    where it was moved. None where there is nothing to tell it by.
    """

    identifiable: float
    error: float | None
    error_p90: float | None
    covered: float | None
    worst_sd: float | None
    slope: float | None
    slope_se: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Some cases: `rotation_deg` and `height_error` are of the served pose, medians and p90.

    `beyond` counts cases with an identifiable parameter more than 5 standard deviations off,
    `sound` is the share of parameters that are covered or declared, `cut` the share of cases with a
    window that was cut though nothing moved, `failed` of those in which nothing was known.
    """

    cases: int
    reference_tracks: float
    seen_tracks: float
    rotation_deg: float
    rotation_p90_deg: float
    height_error: float
    height_error_p90: float
    parameters: tuple[ParameterFigures, ...]
    beyond: int
    sound: float
    cut: float
    mapped: float
    failed: float


def figures_of(outcomes: Sequence[ServedOutcome]) -> Figures:
    """The figures of at least one outcome."""
    known = [outcome for outcome in outcomes if outcome.parameters]
    columns = [[outcome.parameters[place] for outcome in known] for place in range(len(PARAMETERS))]
    every = [parameter for outcome in known for parameter in outcome.parameters]
    rotation = np.array([outcome.rotation_deg for outcome in outcomes])
    height = np.array([outcome.height_error for outcome in outcomes])
    worst = [max((n.off_sd for n in o.parameters if n.identifiable), default=0.0) for o in known]
    return Figures(
        cases=len(outcomes),
        reference_tracks=float(np.mean([outcome.reference_tracks for outcome in outcomes])),
        seen_tracks=float(np.mean([outcome.seen_tracks for outcome in outcomes])),
        rotation_deg=float(np.median(rotation)),
        rotation_p90_deg=float(np.quantile(rotation, 0.9)),
        height_error=float(np.median(height)),
        height_error_p90=float(np.quantile(height, 0.9)),
        parameters=tuple(_parameter(column, len(outcomes)) for column in columns),
        beyond=sum(off > FARTHEST_SD for off in worst),
        sound=float(np.mean([n.covered or not n.identifiable for n in every])) if every else 1.0,
        cut=float(np.mean([outcome.cuts > 0 for outcome in outcomes])),
        mapped=float(np.mean([outcome.mapped for outcome in outcomes])),
        failed=float(np.mean([not outcome.parameters for outcome in outcomes])),
    )


def _parameter(column: Sequence[ParameterOutcome], cases: int) -> ParameterFigures:
    own = [parameter for parameter in column if parameter.identifiable]
    errors = np.abs([parameter.error for parameter in own])
    moved = np.array([parameter.moved for parameter in own])
    slope, slope_se = slope_with_error(moved, moved + [parameter.error for parameter in own])
    return ParameterFigures(
        identifiable=len(own) / cases,
        error=float(np.median(errors)) if own else None,
        error_p90=float(np.quantile(errors, 0.9)) if own else None,
        covered=float(np.mean([parameter.covered for parameter in own])) if own else None,
        worst_sd=max(parameter.off_sd for parameter in own) if own else None,
        slope=slope,
        slope_se=slope_se,
    )
