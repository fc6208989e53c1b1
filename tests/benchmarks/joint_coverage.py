"""How often the joint estimator's intervals cover, and how its errors stand to their bound.

    python -m tests.benchmarks.joint_coverage --sites 30

Of so many simulated sites, each with a camera that was knocked at random: 90 % intervals, errors
of few tracks and of many, and the Cramer-Rao bound of those of many.
"""

import argparse
import math
import sys
from dataclasses import dataclass

import numpy as np

from models.estimation.joint.estimate import joint_estimate
from models.estimation.joint.reference import learn_reference
from models.estimation.numbers import numbers_of
from models.evaluation.scenes import Knock
from models.geometry.rotation import Array
from models.simulation.walkers import WalkConfig
from tests.models.sites import PRIOR, seen, tracks_of

FEW, MANY = 50, 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Of tilt, roll, log height: the share (3,) of 90 % intervals that cover, errors (3,) as rms.

    `bound_rms` (3,) is that of the bounds of the estimates by many tracks.
    """

    covered: Array
    few_rms: Array
    many_rms: Array
    bound_rms: Array


def coverage_of(sites: int) -> Coverage:
    """What the estimates of so many sites come to; the first sites are always the same."""
    errors, sds, bounds = np.zeros((3, sites, 2, 3))
    for site in range(sites):
        tilt, roll, log_height = np.random.default_rng([9, site]).uniform(-1, 1, 3)
        knocked = Knock(
            tilt_rad=math.radians(8) * tilt,
            roll_rad=math.radians(8) * roll,
            log_height=0.15 * log_height,
        ).apply(PRIOR)
        known, few, many = tracks_of(site, (PRIOR, 300), (knocked, FEW), (knocked, MANY))
        reference = learn_reference(seen(known), PRIOR, WalkConfig(), 0)
        for place, tracks in enumerate((few, many)):
            estimate = joint_estimate(seen(tracks), PRIOR, reference)
            errors[site, place] = estimate.values - numbers_of(knocked)
            sds[site, place] = np.sqrt(np.diag(estimate.covariance))
            bounds[site, place] = np.sqrt(np.diag(estimate.bound))
    few_rms, many_rms = np.sqrt((errors**2).mean(axis=0))
    return Coverage(
        covered=(np.abs(errors) < 1.645 * sds).mean(axis=(0, 1)),
        few_rms=few_rms,
        many_rms=many_rms,
        bound_rms=np.sqrt((bounds[:, 1] ** 2).mean(axis=0)),
    )


def main() -> None:
    """Print the figures, a line for each number of a pose."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sites", type=int, default=30)
    found = coverage_of(parser.parse_args().sites)
    for place, name in enumerate(("tilt", "roll", "log height")):
        sys.stdout.write(
            f"{name:10}  covered {found.covered[place]:.1%}  many / few "
            f"{found.many_rms[place] / found.few_rms[place]:.2f}  many / bound "
            f"{found.many_rms[place] / found.bound_rms[place]:.2f}\n"
        )


if __name__ == "__main__":
    main()
