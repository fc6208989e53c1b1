"""The joint estimate: one pose for all tracks, with a covariance, and what it leaves open.

Ours: covariance = variance inflation * H^-1 + covariance of other modes + what is not known of the
offset; the modes are a mixture, weighed by their posterior. Heads, where they lean as verticals do,
are a second Gaussian on tilt and roll.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import (
    PLANE_PARAMETERS,
    CameraPose,
    PoseParameters,
    identifiable_of,
    plane_parameters_of,
)
from models.geometry.rotation import Array
from models.reasons import Reason, TracksCode, Value
from models.tracks.observations import Observations, of_tracks
from models.walking import config
from models.walking.fit import Channel, Fit, FitStart, fit_pose, starts
from models.walking.heads import HeadEstimate, head_estimate, joined
from models.walking.measures import count_walking_groups
from models.walking.mixed_model import Normal
from models.walking.speed_reference import SpeedReference, channels_of


@dataclass(frozen=True, slots=True, kw_only=True)
class JointEstimate:
    """Tilt, roll, log height (3,) with their covariance (3, 3), the reference's offset taken off.

    `raw` (3,) is before that. `log_likelihood` is over the variance inflation, up to what is
    the same for the same tracks. `identifiable` names those of tilt, roll, height that the
    tracks determine; `reason` says what is missing, and is None where they determine all. `walkers`
    is the number of tracks that were used, `walking_groups` that of people or groups who walked
    independently. `bound` (3, 3) is the Cramer-Rao bound of the likelihood. `others` are other
    poses (3,) that explain the tracks, if not as well. `heads` is the estimate by heads, which
    is part of `values`, and `by_speeds` the one without them; None where heads are of no use.
    `means` are the coefficients of the fields there.
    """

    values: Array
    covariance: Array
    raw: Array
    bound: Array
    log_likelihood: float
    walkers: int
    walking_groups: int
    identifiable: tuple[str, ...]
    reason: Reason | None
    others: tuple[Array, ...] = ()
    heads: HeadEstimate | None = None
    by_speeds: Normal | None = None
    means: tuple[Array, ...] = ()

    @property
    def warm_start(self) -> FitStart:
        """The start of a fit of almost the same tracks."""
        return FitStart(candidate=self.raw, means=self.means, warm=True)

    @property
    def raw_parameters(self) -> PoseParameters:
        """The numbers of `raw` by name; it knows no heading."""
        return PoseParameters.of_array(self.raw)

    @property
    def modes(self) -> tuple[Array, ...]:
        """The ends (3,) of the search, the best first; as `raw`."""
        offset = self.raw - (self.values if self.by_speeds is None else self.by_speeds.mean)
        return self.raw, *(other + offset for other in self.others)

    def beside_strangers(self) -> tuple[Array, Array]:
        """Values (3,) and covariance (3, 3) of people who are not the reference's.

        How fast they walk where is known no better than at any other site; they stand as upright.
        """
        if self.heads is None or self.by_speeds is None:
            return self.values, self.covariance + np.diag(config.PLAUSIBLE_OFFSET**2)
        wide = self.by_speeds.covariance + np.diag(config.PLAUSIBLE_OFFSET**2)
        return joined(self.by_speeds.mean, wide, self.heads)


def joint_estimate(
    observations: Observations,
    prior: CameraPose,
    reference: SpeedReference,
    warm_starts: Sequence[FitStart] = (),
) -> JointEstimate:
    """The pose that explains all tracks best, whatever it was before.

    From the modes of an estimate of almost the same tracks, `warm_starts`, no others are searched.
    """
    channels = channels_of(observations, reference, prior)
    begin = warm_starts
    if not begin:
        few = channels_of(of_tracks(observations, _some(observations)), reference, prior)
        found = starts(few, plane_parameters_of(prior), config.STARTS)
        first = _distinct([fit_pose(few, FitStart(candidate=start), prior) for start in found])
        begin = [FitStart(candidate=fit.candidate) for fit in first]
    ends = _distinct([fit_pose(channels, start, prior) for start in begin])
    heads = head_estimate(observations.heads, reference.heads)
    return _estimate_of(observations, channels, ends, reference, heads)


def joint_at_heading(
    observations: Observations,
    prior: CameraPose,
    reference: SpeedReference,
    candidate: Array,
    joint: JointEstimate | None = None,
    warm_start: FitStart | None = None,
) -> JointEstimate:
    """The joint estimate with the heading of a candidate (4,), tilt, roll, log height, heading.

    How fast people are where, and which way, is another question once a camera has been panned.
    What their heads say, the `joint` estimate's `heads`, is not. It begins at the warm start, or
    else at the candidate.
    """
    heads, means = (None, ()) if joint is None else (joint.heads, joint.means)
    start = warm_start or FitStart(candidate=candidate[:3] + reference.offset, means=means)
    turned = replace(prior, heading_rad=math.remainder(float(candidate[3]), 2 * math.pi))
    channels = channels_of(observations, reference, turned)
    fit = fit_pose(channels, start, prior)
    return _estimate_of(observations, channels, [fit], reference, heads)


def _estimate_of(
    observations: Observations,
    channels: Sequence[Channel],
    ends: list[Fit],
    reference: SpeedReference,
    heads: HeadEstimate | None,
) -> JointEstimate:
    """The estimate by the modes that fits ended at, the best first, and by heads."""
    if heads is not None and not heads.identifiable:
        heads = None
    if heads is not None:
        ends = _by_heads(ends, heads, reference)
    best = ends[0]
    covariance = best.covariance * reference.pose_variance_inflation + _covariance_of_modes(
        ends, reference
    )
    walking_groups = count_walking_groups(
        channels[0].measure(candidate=best.candidate, sloped=False)
    )
    # One walking group is one draw of pace and pauses, however many tracks it has.
    covariance = covariance * max(1.0, config.FEWEST_GROUPS / max(walking_groups, 1))
    values = best.candidate - reference.offset
    covariance = covariance + reference.offset_covariance
    by_speeds = None
    if heads is not None:
        by_speeds = Normal(mean=values, covariance=covariance)
        values, covariance = joined(values, covariance, heads)
    sd = np.sqrt(np.diag(covariance))
    identifiable = identifiable_of(PLANE_PARAMETERS, sd)
    reason = _reason(identifiable, sd, covariance)
    if walking_groups < config.FEWEST_GROUPS:
        identifiable = ()
        reason = Reason(
            code=TracksCode.TOO_FEW_GROUPS,
            values={
                "tracks": observations.walkers,
                "parties": int(walking_groups),
                "least_parties": config.FEWEST_GROUPS,
            },
        )
    return JointEstimate(
        values=values,
        covariance=covariance,
        raw=best.candidate,
        bound=best.bound,
        log_likelihood=best.log_likelihood / reference.pose_variance_inflation,
        walkers=observations.walkers,
        walking_groups=walking_groups,
        identifiable=identifiable,
        reason=reason,
        others=tuple(
            end.candidate - reference.offset
            for end in ends[1:]
            if end.log_likelihood
            > best.log_likelihood - config.LEAST_LOG_ODDS * reference.pose_variance_inflation
        ),
        heads=heads,
        by_speeds=by_speeds,
        means=best.means,
    )


def _by_heads(ends: list[Fit], heads: HeadEstimate, reference: SpeedReference) -> list[Fit]:
    """Modes weighed by how likely the heads are there, too, the best first."""
    inflation = reference.pose_variance_inflation
    weighed = []
    for end in ends:
        values = (end.candidate - reference.offset)[:2]
        covariance = (end.covariance * inflation + reference.offset_covariance)[:2, :2]
        likely = heads.log_density(values, covariance)
        together = end.log_likelihood + inflation * likely
        weighed.append(replace(end, log_likelihood=together))
    return sorted(weighed, key=lambda end: -end.log_likelihood)


def _some(observations: Observations) -> np.ndarray:
    """Ascending indices of tracks, evenly spaced, enough for a start."""
    walkers = np.unique(observations.steps.rows.owner_idx)
    places = np.linspace(0, walkers.size - 1, min(config.START_TRACKS, walkers.size)).astype(
        np.int64
    )
    return np.asarray(walkers[places])


def _distinct(ends: list[Fit]) -> list[Fit]:
    """Modes that are not about the same pose, the best first."""
    distinct: list[Fit] = []
    for end in sorted(ends, key=lambda end: -end.log_likelihood):
        if all((np.abs(end.candidate - d.candidate) > config.SAME_MODE).any() for d in distinct):
            distinct.append(end)
    return distinct


def _covariance_of_modes(ends: list[Fit], reference: SpeedReference) -> Array:
    """The covariance (3, 3) by other modes, which explain the tracks about as well."""
    best = ends[0]
    log_odds = [end.log_likelihood - best.log_likelihood for end in ends]
    odds = np.exp(np.array(log_odds) / reference.pose_variance_inflation)
    odds = odds / odds.sum()
    apart = np.array([end.candidate - best.candidate for end in ends])
    return np.asarray((apart * odds[:, None]).T @ apart)


def _reason(identifiable: tuple[str, ...], sd: Array, covariance: Array) -> Reason | None:
    """A reason that names what is not identifiable; `alike` two that make up for one another."""
    missing = [name for name in PLANE_PARAMETERS if name not in identifiable]
    if not missing:
        return None
    names = {"tilt": "tilt_sd_rad", "roll": "roll_sd_rad", "height": "log_height_sd"}
    values: dict[str, Value] = {
        names[name]: float(sd[PLANE_PARAMETERS.index(name)]) for name in missing
    }
    correlation = covariance / np.outer(sd, sd)
    pairs = [(0, 2), (1, 2), (0, 1)]
    first, second = max(pairs, key=lambda pair: abs(correlation[pair]))
    if abs(correlation[first, second]) > 0.9:
        values["alike"] = [PLANE_PARAMETERS[first], PLANE_PARAMETERS[second]]
    return Reason(code=TracksCode.UNIDENTIFIABLE, values=values)
