"""The fused pose: the joint estimate's speeds and the flow map's places, in one posterior.

Ours: log p(pose) = log N(pose; joint estimate) + log likelihood of the map / variance inflation.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.plane_parameters import IDENTIFIABLE_SD, identifiable_of
from models.geometry.pose import CameraPose
from models.geometry.pose_parameters import PARAMETERS, PoseParameters
from models.geometry.rotation import Array
from models.paths.heading import on_known_ground, variance_of_halves
from models.paths.likelihood import walkers_of
from models.paths.path_test import group_fits
from models.paths.reference import FlowReference, candidate_of
from models.paths.registration import Posterior, settled, shape_at
from models.pose.modes import (
    HEADING_SD,
    REACH_RAD,
    apart,
    elsewhere,
    ends_of,
    flatter,
    odds_of,
)
from models.quantiles import chi_squared_above
from models.reasons import Reason, TracksCode
from models.tracks.observations import Observations
from models.walking.estimate import JointEstimate
from models.walking.fit import Near
from models.walking.speed_reference import SpeedReference

_FEWEST_GROUPS = 5
_EDGE_RAD = math.radians(2.0)
_FAR_APART = 6.6  # of a variance: chance makes two halves differ by more in one case of 100
_LITTLE = 0.1  # of a variance
_NOT_FAR = 0.5  # of that: what is less is far from it, looked at roughly
_BY_CHANCE = 0.01  # tilt and roll of a camera that stands are so far off in so many cases
_RIVAL = 0.05  # how likely, against the best, another pose must be to be named
_NO_RIVAL = 1e-6  # and as unlikely as this, it has nothing to do with the covariance


@dataclass(frozen=True, slots=True, kw_only=True)
class Around:
    """What was found around an end, and is about the same of almost the same tracks.

    `told` is what the speeds say with its heading. `wider` (4, 4) was added to the covariance for
    other ends, for a posterior that is no Gaussian, and for halves that tell other headings.
    """

    told: Near
    wider: Array

    def narrow(self, covariance: Array) -> bool:
        """Whether so little of a covariance (4, 4) was added that it need not be asked anew."""
        return float(self.wider[3, 3]) < _LITTLE * float(covariance[3, 3])


@dataclass(frozen=True, slots=True, kw_only=True)
class FusedEstimate:
    """Tilt, roll, log height, heading (4,) with their covariance (4, 4).

    `identifiable` names those of tilt, roll, height, heading that the tracks determine; `reason`
    is what is to be said of the flow map, if anything. `raw` (4,) is before the map's bias is taken
    off; None where the map had no part: then all is the joint estimate's and the heading the prior
    pose's.
    `rivals` are headings (radians) of other poses that explain the tracks about as well. `ends`
    (4,) are where the search ended, the best first: `raw`, and what may have to do with the
    covariance. `fit` is the sum over walking groups of how well they fit the map at `raw`, in logs.
    `around` is what else was found there; None where the map had no part.
    """

    values: Array
    covariance: Array
    identifiable: tuple[str, ...]
    reason: Reason | None
    raw: Array | None = None
    rivals: tuple[float, ...] = ()
    ends: tuple[Array, ...] = ()
    fit: float = 0.0
    around: Around | None = None

    @property
    def registered(self) -> bool:
        """Whether the flow map had a part."""
        return self.raw is not None

    @property
    def parameters(self) -> PoseParameters:
        """What is estimated, named."""
        return PoseParameters.of_array(self.values)

    @property
    def sd(self) -> PoseParameters:
        """The standard deviations, named."""
        return PoseParameters.sd_of_array(self.covariance, self.parameters.height_m)

    @property
    def raw_parameters(self) -> PoseParameters | None:
        """What `raw` is, named."""
        return None if self.raw is None else PoseParameters.of_array(self.raw)


def fused_estimate(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    joint: JointEstimate,
    speed_reference: SpeedReference,
    reference: FlowReference,
    near: Sequence[Array] = (),
    around: Around | None = None,
) -> FusedEstimate:
    """The pose by speeds and places together.

    A track's speeds, given where and which way it goes, and where it goes are two factors of one
    likelihood. Of the speeds all is taken that their fit says around its end; what people's places
    are is asked anew there, and with the heading that comes of it the speeds are.

    Args:
        observations: of the tracks.
        intrinsics: of the camera.
        prior: where it was.
        joint: what the speeds say, the heading taken for the prior pose's.
        speed_reference: how people walk at the site.
        reference: where they do.
        near: the `ends` (4,) of almost the same tracks, where it is known to be near them; else
            poses all around are tried.
        around: what was found there of them, where there was a single end; else it is asked anew.
    """
    walkers = walkers_of(observations, np.append(joint.values, prior.heading_rad))
    if walkers.walking_groups < _FEWEST_GROUPS:
        return by_speeds_alone(joint, prior)
    site = reference.site(intrinsics)
    variance_inflation = reference.variance_inflation_for(walkers.people)
    told_near = None if around is None else around.told
    ends = ends_of(
        walkers,
        site,
        variance_inflation,
        joint,
        observations,
        prior,
        speed_reference,
        near,
        told_near,
    )
    best = ends[0]
    shape = shape_at(walkers, site, best.candidate)
    move = best.candidate - candidate_of(prior)
    fits = group_fits(walkers, site, best.candidate)
    if reference.fit.has_changed(fits):
        stood = group_fits(walkers, site, candidate_of(prior))
        if not reference.fit.has_changed(stood) and _same_angles(joint, prior):
            return by_speeds_alone(joint, prior)  # only times have changed: a clock
        return by_speeds_alone(joint, prior, Reason(code=TracksCode.PATHS_CHANGED))
    known = reference.precision(shape, walkers.people, move)
    known = known / reference.fit.variance_inflation(fits)
    values, covariance = settled(
        walkers,
        site,
        best.belief,
        best.peak,
        shape,
        known,
        reference.bias,
        roughly=around is not None,
    )
    if _out_of_reach(values, prior) or not on_known_ground(walkers, site, values):
        untold = {"heading_sd_rad": HEADING_SD}
        return by_speeds_alone(
            joint, prior, Reason(code=TracksCode.HEADING_UNIDENTIFIABLE, values=untold)
        )
    covariance = covariance * apart(best.belief, known, values)
    odds = odds_of(walkers, site, ends)
    if around is not None and around.narrow(covariance):
        wider = around.wider
    else:
        wider = elsewhere([end.peak for end in ends], odds)
        wider = wider + flatter(best, covariance + wider)
        wider = wider + _unrepeated(best.posterior, values, covariance + wider, afar=not near)
    covariance = covariance + wider
    rivals = tuple(
        float(end.candidate[3])
        for end, against_best in zip(ends, odds, strict=True)
        if end is not best and against_best > _RIVAL
    )
    sd = np.sqrt(np.diag(covariance))
    return FusedEstimate(
        values=values,
        covariance=covariance,
        # What speeds leave open, places alone do not tell: crowds that all cross the picture fit a
        # map at a tilt that is ten degrees off, and it seems sharp there.
        identifiable=tuple(
            name
            for name in identifiable_of(PARAMETERS, sd)
            if name == "heading" or name in joint.identifiable
        ),
        reason=_reason(float(values[3]), rivals, float(sd[3]), prior),
        raw=best.candidate,
        rivals=rivals,
        ends=tuple(
            end.candidate
            for end, against_best in zip(ends, odds, strict=True)
            if end is best or against_best > _NO_RIVAL
        ),
        fit=float(fits.sum()),
        around=Around(told=best.told.near, wider=wider),
    )


def by_speeds_alone(
    joint: JointEstimate, prior: CameraPose, reason: Reason | None = None
) -> FusedEstimate:
    """The joint estimate with the prior's heading, which speeds leave open.

    Where people were held against a map and do not fit it, as the `reason` says, they are not the
    reference's people: how fast these walk where is known no better than at any other site.
    """
    covariance = np.zeros((4, 4))
    values, covariance[:3, :3] = joint.values, joint.covariance
    if reason is not None:
        values, covariance[:3, :3] = joint.beside_strangers()
    covariance[3, 3] = HEADING_SD**2
    known = identifiable_of(PARAMETERS, np.sqrt(np.diag(covariance)))
    return FusedEstimate(
        values=np.append(values, prior.heading_rad),
        covariance=covariance,
        identifiable=tuple(name for name in joint.identifiable if name in known),
        reason=reason,
    )


def _reason(
    heading: float, rivals: tuple[float, ...], sd: float, prior: CameraPose
) -> Reason | None:
    if rivals:
        turns = sorted(turn - prior.heading_rad for turn in (heading, *rivals))
        return Reason(code=TracksCode.HEADING_AMBIGUOUS, values={"turns_rad": turns})
    if sd > IDENTIFIABLE_SD[3]:
        return Reason(code=TracksCode.HEADING_UNIDENTIFIABLE, values={"heading_sd_rad": sd})
    return None


def _out_of_reach(values: Array, prior: CameraPose) -> bool:
    """Whether a heading is at the edge of those that were tried: beyond may be a better one."""
    return abs(float(values[3]) - prior.heading_rad) > REACH_RAD - _EDGE_RAD


def _same_angles(joint: JointEstimate, prior: CameraPose) -> bool:
    """Whether speeds tell no turn in tilt or roll, whatever they say of the scale."""
    turn = joint.values[:2] - candidate_of(prior)[:2]
    squared = float(turn @ np.linalg.solve(joint.covariance[:2, :2], turn))
    return squared < chi_squared_above(_BY_CHANCE, 2)


def _unrepeated(posterior: Posterior, values: Array, covariance: Array, *, afar: bool) -> Array:
    """What is added to the covariance (4, 4) where halves of the people tell other headings."""
    variance = float(covariance[3, 3])
    line = covariance[:, 3] / variance
    by_halves = variance_of_halves(posterior, values, line, afar=afar)
    if not afar and by_halves > _NOT_FAR * _FAR_APART * variance:
        by_halves = variance_of_halves(posterior, values, line)
    if by_halves < _FAR_APART * variance:
        return np.zeros((4, 4))
    return (by_halves - variance) * np.outer(line, line)
