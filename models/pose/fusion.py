"""The fused pose: the joint estimate's speeds and the places of the paths, in one posterior.

Ours: log p(pose) = log N(pose; joint estimate) + log likelihood of the paths / variance inflation.
"""

import numpy as np

from models.geometry.plane_parameters import IDENTIFIABLE_SD, identifiable_of
from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PARAMETERS
from models.geometry.rotation import Array
from models.paths.heading import on_known_ground, variance_of_halves
from models.paths.likelihood import walkers_of
from models.paths.path_test import group_fits
from models.paths.reference import FlowReference, candidate_of
from models.paths.registration import Posterior, refined, shape_at
from models.pose.config import (
    BY_CHANCE,
    CLOSE,
    EDGE_RAD,
    FAR_APART,
    FEWEST_GROUPS,
    HEADING_SD,
    NO_RIVAL,
    REACH_RAD,
    RIVAL,
)
from models.pose.modes import (
    Mode,
    belief_of,
    birge_ratio,
    covariance_between,
    covariance_beyond_gaussian,
    find_modes,
    odds_of,
)
from models.pose.pose_fit import FusedEstimate, PathNeighbourhood, by_speeds_alone
from models.pose.site import CameraSite
from models.pose.warm_start import WarmStart
from models.quantiles import chi_squared_above
from models.reasons import Reason, TracksCode
from models.tracks.observations import Observations
from models.walking.estimate import JointEstimate


def fused_estimate(
    tracks: Observations,
    site: CameraSite,
    joint: JointEstimate,
    warm_start: WarmStart | None = None,
) -> FusedEstimate:
    """The pose by speeds and places together; by speeds alone where places do not tell it.

    A track's speeds, given where and which way it goes, and where it goes are two factors of one
    likelihood. Of the speeds all is taken that their fit says around its mode; what people's places
    are is asked anew there, and with the heading that comes of it the speeds are.

    Args:
        tracks: of one pose.
        site: with the paths of its people, if they are known.
        joint: by speeds, the heading taken for the prior pose's.
        warm_start: the pose of almost the same tracks; without one, poses all around are tried.
    """
    flow, prior = site.flow, site.prior
    if flow is None:
        return by_speeds_alone(joint, prior)
    walkers = walkers_of(tracks, np.append(joint.values, prior.heading_rad))
    if walkers.walking_groups < FEWEST_GROUPS:
        return by_speeds_alone(joint, prior)
    posterior = Posterior(
        walkers=walkers,
        site=flow.site(site.intrinsics),
        belief=belief_of(joint, prior),
        variance_inflation=flow.variance_inflation_for(walkers.people),
    )
    modes = find_modes(posterior, tracks, site, joint, warm_start)
    fits = group_fits(walkers, posterior.site, modes[0].candidate)
    if flow.fit.has_changed(fits):
        return by_speeds_alone(joint, prior, _changed_paths(posterior, flow, joint, prior))
    values, covariance = _refined(modes[0], flow, prior, fits, warm_start)
    if _out_of_reach(values, prior) or not on_known_ground(walkers, posterior.site, values):
        return by_speeds_alone(joint, prior, _unidentifiable(HEADING_SD))
    odds = odds_of(modes)
    extra = _extra_covariance(modes, odds, values, covariance, warm_start)
    return _estimate_of(modes, odds, values, covariance + extra, extra, fits, joint, prior)


def _changed_paths(
    posterior: Posterior, flow: FlowReference, joint: JointEstimate, prior: CameraPose
) -> Reason | None:
    """What is to be said of people who fit no pose; nothing if only times changed, by a clock."""
    at_prior = group_fits(posterior.walkers, posterior.site, candidate_of(prior))
    if not flow.fit.has_changed(at_prior) and _same_angles(joint, prior):
        return None
    return Reason(code=TracksCode.PATHS_CHANGED)


def _same_angles(joint: JointEstimate, prior: CameraPose) -> bool:
    """Whether speeds tell no turn in tilt or roll, whatever they say of the scale."""
    turn = joint.values[:2] - candidate_of(prior)[:2]
    squared = float(turn @ np.linalg.solve(joint.covariance[:2, :2], turn))
    return squared < chi_squared_above(BY_CHANCE, 2)


def _refined(
    mode: Mode,
    flow: FlowReference,
    prior: CameraPose,
    fits: Array,
    warm_start: WarmStart | None,
) -> tuple[Array, Array]:
    """The pose (4,) around a mode with each direction of the paths weighed, and its covariance."""
    walkers, paths = mode.posterior.walkers, mode.posterior.site
    shape = shape_at(walkers, paths, mode.candidate)
    precision = flow.precision(shape, walkers.people, mode.candidate - candidate_of(prior))
    precision = precision / flow.fit.variance_inflation(fits)
    warm = warm_start is not None and warm_start.neighbourhood is not None
    values, covariance = refined(
        mode.posterior, mode.candidate, shape, precision, flow.bias, warm=warm
    )
    return values, covariance * birge_ratio(mode.posterior.belief, precision, values)


def _out_of_reach(values: Array, prior: CameraPose) -> bool:
    """Whether a heading is at the edge of those that were tried: beyond may be a better one."""
    return abs(float(values[3]) - prior.heading_rad) > REACH_RAD - EDGE_RAD


def _extra_covariance(
    modes: list[Mode],
    odds: Array,
    values: Array,
    covariance: Array,
    warm_start: WarmStart | None,
) -> Array:
    """The covariance (4, 4) by other modes, by flat tails, and by halves that do not agree."""
    around = None if warm_start is None else warm_start.neighbourhood
    if around is not None and around.is_narrow(covariance):
        return around.extra_covariance
    extra = covariance_between([mode.peak for mode in modes], odds)
    extra = extra + covariance_beyond_gaussian(modes[0], covariance + extra)
    afar = warm_start is None
    return extra + _covariance_of_halves(modes[0].posterior, values, covariance + extra, afar=afar)


def _covariance_of_halves(
    posterior: Posterior, values: Array, covariance: Array, *, afar: bool
) -> Array:
    """The covariance (4, 4) by how far apart halves of the people find the heading, if far."""
    variance = float(covariance[3, 3])
    line = covariance[:, 3] / variance
    by_halves = variance_of_halves(posterior, values, line, afar=afar)
    if not afar and by_halves > CLOSE * FAR_APART * variance:
        by_halves = variance_of_halves(posterior, values, line)
    if by_halves < FAR_APART * variance:
        return np.zeros((4, 4))
    return (by_halves - variance) * np.outer(line, line)


def _estimate_of(
    modes: list[Mode],
    odds: Array,
    values: Array,
    covariance: Array,
    extra: Array,
    fits: Array,
    joint: JointEstimate,
    prior: CameraPose,
) -> FusedEstimate:
    """The estimate of a pose and its covariance, with what else explains the tracks."""
    best, sd = modes[0], np.sqrt(np.diag(covariance))
    others = list(zip(modes[1:], odds[1:], strict=True))
    rivals = tuple(float(mode.candidate[3]) for mode, own in others if own > RIVAL)
    near = [mode.candidate for mode, own in others if own > NO_RIVAL]
    # What speeds leave open, places alone do not tell: crowds that all cross the picture fit a map
    # at a tilt that is ten degrees off, and it seems sharp there.
    determined = ("heading", *joint.identifiable)
    return FusedEstimate(
        values=values,
        covariance=covariance,
        identifiable=tuple(name for name in identifiable_of(PARAMETERS, sd) if name in determined),
        reason=_reason(float(values[3]), rivals, float(sd[3]), prior),
        raw=best.candidate,
        rivals=rivals,
        modes=(best.candidate, *near),
        path_fit=float(fits.sum()),
        neighbourhood=PathNeighbourhood(speeds=best.speeds.warm_start, extra_covariance=extra),
    )


def _reason(
    heading: float, rivals: tuple[float, ...], sd: float, prior: CameraPose
) -> Reason | None:
    """What is wrong with a heading, if anything."""
    if rivals:
        turns = sorted(turn - prior.heading_rad for turn in (heading, *rivals))
        return Reason(code=TracksCode.HEADING_AMBIGUOUS, values={"turns_rad": turns})
    return _unidentifiable(sd) if sd > IDENTIFIABLE_SD[3] else None


def _unidentifiable(heading_sd_rad: float) -> Reason:
    return Reason(code=TracksCode.HEADING_UNIDENTIFIABLE, values={"heading_sd_rad": heading_sd_rad})
