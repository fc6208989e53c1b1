"""The fused pose: the joint estimate's speeds and the places of the paths, in one posterior.

Ours: log p(pose) = log N(pose; joint estimate) + log likelihood of the paths / variance inflation.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from models.geometry.pose import IDENTIFIABLE_SD, PARAMETERS, CameraPose, array_of, identifiable_of
from models.geometry.rotation import Array
from models.paths.likelihood import walkers_of
from models.paths.path_tests import group_fits, loss
from models.paths.reference import PathReference
from models.paths.registration import (
    Posterior,
    distinct,
    refined,
    shape_at,
)
from models.pose import config
from models.pose.modes import (
    Mode,
    belief_of,
    birge_ratio,
    covariance_between,
    find_modes,
    odds_of,
)
from models.pose.pose_fit import (
    Alternative,
    FusedEstimate,
    WarmStart,
    by_speeds_alone,
)
from models.pose.site import CameraSite
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
    """The pose by speeds and places together; by speeds alone where places do not determine it.

    A track's speeds, given where and which way it goes, and where it goes are two factors of one
    likelihood. That of the speeds is a Gaussian around its mode; that of the places is evaluated
    there, and the speeds are fitted again with the heading that comes of it.

    `joint` takes the prior pose's heading. Without `warm_start`, the pose of almost the same
    tracks, poses all around are tried.
    """
    paths, prior = site.paths, site.prior
    if paths is None:
        return by_speeds_alone(joint, prior)
    walkers = walkers_of(tracks, np.append(joint.values, prior.heading_rad))
    if walkers.walking_groups < config.FEWEST_GROUPS:
        return by_speeds_alone(joint, prior)
    posterior = Posterior(
        walkers=walkers,
        paths=paths.model(site.intrinsics),
        belief=belief_of(joint, prior),
        variance_inflation=paths.variance_inflation_for(walkers.people),
    )
    fitting = _fitting(find_modes(posterior, tracks, site, joint, warm_start), paths)
    if warm_start is None and (not fitting or paths.fit.is_doubtful(fitting[0][1])):
        far = find_modes(posterior, tracks, site, joint, headings=config.FAR_HEADINGS)
        fitting = _distinct(fitting + _fitting(far, paths))
    changed = partial(_changed_paths, posterior, paths, joint, prior)
    if not fitting:
        return by_speeds_alone(joint, prior, changed())
    modes, fits = [mode for mode, _ in fitting], fitting[0][1]
    values, covariance = _refined(modes[0], paths, prior, fits, warm_start)
    if covariance[3, 3] > config.HEADING_SD**2:  # the paths say nothing
        return by_speeds_alone(joint, prior, changed())
    odds = odds_of(modes)
    covariance = covariance + covariance_between([mode.peak for mode in modes], odds)
    found = _estimate_of(modes, odds, values, covariance, fits, joint, prior)
    at_prior = float(posterior.values(array_of(prior)[None])[0])
    return replace(found, prior_gap=2 * (modes[0].peak.value - at_prior))


def _fitting(modes: list[Mode], paths: PathReference) -> list[tuple[Mode, Array]]:
    """The modes at which people walk where they did, each with the fits of walking groups (P,).

    Elsewhere they are on ground of which nothing is known, or have left their paths.
    """
    found = []
    for mode in modes:
        walkers = mode.posterior.walkers
        fits = group_fits(walkers, mode.posterior.paths, mode.candidate)
        if fits.size >= config.ON_MAP * walkers.walking_groups and not paths.fit.has_changed(fits):
            found.append((mode, fits))
    return found


def _distinct(modes: list[tuple[Mode, Array]]) -> list[tuple[Mode, Array]]:
    """The modes that are not about the same, the highest first: both searches may find one."""
    peaks = distinct([mode.peak for mode, _ in modes])
    return [next(each for each in modes if each[0].peak is peak) for peak in peaks]


def _changed_paths(
    posterior: Posterior, paths: PathReference, joint: JointEstimate, prior: CameraPose
) -> Reason | None:
    """The reason of people who fit no pose; None if only times changed, by a clock.

    A crowd that turns over a day walks the same ground another way; a camera that was turned has
    people on other ground.
    """
    at = array_of(prior)
    at_prior = group_fits(posterior.walkers, posterior.paths, at)
    if not paths.fit.has_changed(at_prior) and _same_angles(joint, prior):
        return None
    places = group_fits(posterior.walkers, posterior.paths.undirected, at)
    if paths.place_fit.has_changed(places):
        return Reason(code=TracksCode.PATHS_CHANGED)
    return Reason(code=TracksCode.WAYS_CHANGED)


def _same_angles(joint: JointEstimate, prior: CameraPose) -> bool:
    """True if speeds show no turn in tilt or roll, whatever they show of the scale."""
    turn = joint.values[:2] - array_of(prior)[:2]
    squared = float(turn @ np.linalg.solve(joint.covariance[:2, :2], turn))
    return squared < chi_squared_above(config.BY_CHANCE, 2)


def _refined(
    mode: Mode,
    paths: PathReference,
    prior: CameraPose,
    fits: Array,
    warm_start: WarmStart | None,
) -> tuple[Array, Array]:
    """The pose (4,) around a mode with each direction of the paths weighed, and its covariance."""
    walkers = mode.posterior.walkers
    shape = shape_at(walkers, mode.posterior.paths, mode.candidate)
    precision = paths.precision(shape, walkers.people, mode.candidate - array_of(prior))
    precision = precision / paths.fit.variance_inflation(fits)
    warm = warm_start is not None and warm_start.speeds is not None
    values, covariance = refined(
        mode.posterior, mode.candidate, shape, precision, paths.bias, warm=warm
    )
    return values, covariance * birge_ratio(mode.posterior.belief, precision, values)


def _estimate_of(
    modes: list[Mode],
    odds: Array,
    values: Array,
    covariance: Array,
    fits: Array,
    joint: JointEstimate,
    prior: CameraPose,
) -> FusedEstimate:
    """The estimate of a pose and its covariance, with what else explains the tracks."""
    best, sd = modes[0], np.sqrt(np.diag(covariance))
    others = list(zip(modes[1:], odds[1:], strict=True))
    alternatives = tuple(
        Alternative(values=mode.candidate, weight=float(own / odds.sum()))
        for mode, own in others
        if own > config.ALTERNATIVE
    )
    near = [mode.candidate for mode, own in others if own > config.NO_ALTERNATIVE]
    # What speeds leave open, places alone do not determine: crowds that all cross the picture fit
    # a map at a tilt that is ten degrees off, and it seems sharp there.
    determined = ("heading", *joint.identifiable)
    return FusedEstimate(
        values=values,
        covariance=covariance,
        identifiable=tuple(name for name in identifiable_of(PARAMETERS, sd) if name in determined),
        reason=_reason(float(values[3]), alternatives, float(sd[3]), prior),
        raw=best.candidate,
        alternatives=alternatives,
        modes=(best.candidate, *near),
        path_fit=float(fits.sum()),
        prior_loss=loss(
            best.posterior.walkers, best.posterior.paths, best.candidate, array_of(prior)
        ),
        speeds=best.speeds.warm_start,
    )


def _reason(
    heading: float, alternatives: tuple[Alternative, ...], sd: float, prior: CameraPose
) -> Reason | None:
    """The reason of a heading that is ambiguous or unsure; None of others."""
    if alternatives:
        turns = sorted(
            turn - prior.heading_rad
            for turn in (heading, *(float(alternative.values[3]) for alternative in alternatives))
        )
        return Reason(code=TracksCode.HEADING_AMBIGUOUS, values={"turns_rad": turns})
    return _unidentifiable(sd) if sd > IDENTIFIABLE_SD[3] else None


def _unidentifiable(heading_sd_rad: float) -> Reason:
    return Reason(code=TracksCode.HEADING_UNIDENTIFIABLE, values={"heading_sd_rad": heading_sd_rad})
