"""The flow map as the protocol runs it: in the pose that is served, and alone."""

from dataclasses import replace

import numpy as np

from models.geometry.pose import PLANE_PARAMETERS, array_of, identifiable_of
from models.geometry.rotation import Array
from models.paths.likelihood import walkers_of
from models.paths.registration import Belief, Peak, Posterior, refined, register, shape_at
from models.pose import CameraSite, Observations
from models.pose.modes import covariance_between
from studies.protocol.cases import Answer, nothing_identifiable
from studies.protocol.learned import Learned
from studies.protocol.served import served_pose

_HEADINGS = np.radians(np.arange(-24.0, 25.0, 4.0))
# Tilts and rolls around the prior's: paths are narrow, a climb from 8 deg off ends beside them.
_NODES = [np.radians([tilt, roll, 0, 0]) for tilt in (-6, 0, 6) for roll in (-6, 0, 6)]
_CLIMBED = 2
_SAME_END = np.radians(0.3)
_BROAD = np.diag(np.array([np.radians(8), np.radians(8), 0.2, np.radians(15)]) ** -2.0)
_FEWEST = 5


def fused(learned: Learned) -> Answer:
    """As it is served: speeds and places together, from the newest change on; the heading too."""
    return served_answer(learned.seen, learned.site)


def served_answer(seen: Observations, site: CameraSite) -> Answer:
    """The pose that the service would serve of what is seen."""
    found = served_pose(seen, site)
    pose = found.fused
    answer = Answer(
        values=pose.values[:3],
        covariance=pose.covariance[:3, :3],
        tracks=found.joint.walkers,
        identifiable=tuple(name for name in PLANE_PARAMETERS if name in pose.identifiable),
    )
    return (
        _with_heading(answer, pose.values, pose.covariance)
        if "heading" in pose.identifiable
        else answer
    )


def registration(learned: Learned) -> Answer:
    """The flow map alone, around the prior pose: nothing is known of speeds."""
    case, reference = learned.case, learned.site.paths
    if reference is None:
        return nothing_identifiable(case)
    mean = array_of(case.prior_pose)
    walkers = walkers_of(learned.seen, mean)
    if walkers.walking_groups < _FEWEST:
        return nothing_identifiable(case)
    paths, variance_inflation = (
        reference.model(case.intrinsics),
        reference.variance_inflation_for(walkers.people),
    )
    posterior = Posterior(
        walkers=walkers,
        paths=paths,
        belief=Belief(mean=mean, precision=_BROAD),
        variance_inflation=variance_inflation,
    )
    peaks = _peaks(posterior)
    best = peaks[0]
    shape = shape_at(walkers, paths, best.candidate)
    known = reference.precision(shape, walkers.people, best.candidate - mean)
    values, covariance = refined(posterior, best.candidate, shape, known, reference.bias)
    chances = np.exp([peak.value - best.value for peak in peaks])
    covariance = covariance + covariance_between(peaks, chances)
    sd = np.sqrt(np.diag(covariance))[:3]
    answer = replace(
        nothing_identifiable(case),
        tracks=int(walkers.people),
        identifiable=identifiable_of(PLANE_PARAMETERS, sd),
    )
    return _with_heading(answer, values, covariance)


def _peaks(posterior: Posterior) -> list[Peak]:
    """Peaks under a broad belief, the highest first, climbed to from the likeliest nodes."""
    belief = posterior.belief
    turns = np.outer(_HEADINGS, [0.0, 0.0, 0.0, 1.0])
    starts = {
        number: float(posterior.values(belief.mean + node + turns).max())
        for number, node in enumerate(_NODES)
    }
    likeliest = sorted(starts, key=lambda number: -starts[number])
    peaks: list[Peak] = []
    for node in (_NODES[number] for number in likeliest[:_CLIMBED]):
        around = replace(belief, mean=belief.mean + node)
        for peak in register(replace(posterior, belief=around), _HEADINGS):
            # The belief stood at the node; one step takes the peak to where it is around the mean.
            bent = shape_at(posterior.walkers, posterior.paths, peak.candidate).curvature
            precision = bent / posterior.variance_inflation + belief.precision
            candidate = peak.candidate - np.linalg.solve(precision, belief.precision @ node)
            if all(np.abs(candidate - other.candidate).max() > _SAME_END for other in peaks):
                value = float(posterior.values(candidate[None])[0])
                peaks.append(replace(peak, candidate=candidate, value=value))
    return sorted(peaks, key=lambda peak: -peak.value)


def _with_heading(answer: Answer, values: Array, covariance: Array) -> Answer:
    """The answer with tilt, roll, log height, heading (4,) and their covariance (4, 4)."""
    return replace(
        answer,
        values=values[:3],
        covariance=covariance[:3, :3],
        heading_rad=float(values[3]),
        heading_sd_rad=float(np.sqrt(covariance[3, 3])),
    )
