"""Quantiles that limits and intervals are read from."""

from functools import cache
from statistics import NormalDist

Z90 = NormalDist().inv_cdf(0.95)  # half the width of a 90 % interval, in standard deviations
# Of a normal, over the median of the absolute deviations; to the digits that sites and charts
# were learned with.
SD_OF_MEDIAN_DEVIATION = round(1 / NormalDist().inv_cdf(0.75), 4)


@cache
def chi_squared_above(chance: float, freedom: int) -> float:
    """Quantile that a chi-squared of some degrees of freedom is above with a chance."""
    from scipy.special import chdtri  # late: the HTTP process has no use for it

    return float(chdtri(freedom, chance))


@cache
def f_above(chance: float, freedom: int, other_freedom: int) -> float:
    """Quantile that an F of two degrees of freedom is above with a chance."""
    from scipy.special import fdtri

    return float(fdtri(freedom, other_freedom, 1 - chance))


def chance_below(value: float, freedom: float) -> float:
    """The chance that a Student's t of some degrees of freedom is below a value.

    Source: Student 1908.
    """
    from scipy.special import stdtr

    return float(stdtr(freedom, value))


def value_below(chance: float, freedom: float) -> float:
    """Quantile that a Student's t of some degrees of freedom is below with a chance."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, chance))
