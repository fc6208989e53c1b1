"""The pose of a camera of which the lens is known and nothing else, from the people before it.

How fast people walk, and how tall they are where boxes measure it, is taken from other sites; that
it is the same everywhere in the picture gives tilt and roll, its amount the height. Installers hang
cameras level, about as high as a pole: a Gaussian each. A site's habits offset what its tracks
show; a measured height, tilt or roll has no such offset, and is weighed after it was added.

Ours: a site's field has a level alone here. One that varies by place explains what a wrong pose
does, the more the higher the camera is thought to be: of five scenes by speeds alone heights came
out 38 to 116 % too large.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import PLANE_PARAMETERS, CameraPose, plane_parameters_of
from models.geometry.rotation import Array
from models.geometry.usual_pose import CONFIRMABLE_SD, measured_precision, usual_pose, usual_sd
from models.pose import config
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations
from models.tracks.trajectory import Trajectory
from models.tracks.walks import observe
from models.walking import config as walking
from models.walking.field import learn
from models.walking.fit import FitStart, best_starts, fit_pose
from models.walking.measures import Measured, count_walking_groups, measure_speeds
from models.walking.mixed_model import Normal
from models.walking.speed_reference import assumed_speed_reference, channels_of, of_levels


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfCalibration:
    """Tilt, roll, log height (3,) with their covariance (3, 3), by people alone.

    `identifiable` names those that are known well enough to be of use, by so many people or groups
    who walked independently. `log_posterior`, of the best end, compares lenses before the same
    people.
    """

    values: Array
    covariance: Array
    identifiable: tuple[str, ...]
    walking_groups: int
    log_posterior: float

    @property
    def pose(self) -> CameraPose:
        """The pose, at the foot of the camera and heading along Y: people tell neither."""
        return _pose_of(self.values)


def self_calibrate(
    trajectories: Sequence[Trajectory],
    intrinsics: Intrinsics,
    walk: WalkConfig,
    measured: Mapping[str, float],
) -> SelfCalibration:
    """The pose that explains people best.

    They are in the order of their ends. `measured` is what somebody has of `tilt_rad`, `roll_rad`,
    `height_m`.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step.
    """
    start = usual_pose(measured)
    # As if it were as many tracks more: what tracks say is too sure by the inflation.
    known = Normal(
        mean=plane_parameters_of(start),
        covariance=np.diag(usual_sd(measured) ** 2) / walking.ASSUMED_INFLATION,
    )
    tracks = observe(trajectories, intrinsics, start)
    reference = of_levels(assumed_speed_reference(tracks, start, walk))
    speeds = channels_of(tracks, reference, start)[:1]
    grid = [
        np.array([tilt, roll, known.mean[2]])
        for tilt in config.CALIBRATION_TILTS_RAD
        for roll in config.CALIBRATION_ROLLS_RAD
    ]
    precision = np.linalg.inv(known.covariance)
    tape = _Tape(mean=known.mean, precision=measured_precision(measured))

    def log_prior(candidate: Array) -> float:
        apart = candidate - known.mean
        return float(-apart @ precision @ apart / 2)

    begins = best_starts(speeds, grid, config.CALIBRATION_STARTS, log_prior)
    ends = [end for each in begins if (end := _end_of(tracks, each, walk, known, tape)) is not None]
    if not ends:
        raise TooFewTrajectoriesError("tracks: no pose in reach explains them")
    return _mixed(ends)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tape:
    """Measured tilt, roll and log height: `mean` (3,), `precision` (3, 3) 0 where not measured."""

    mean: Array
    precision: Array

    def joined_with(self, fitted: Normal, few: float) -> Normal:
        """Posterior of a fit that has the measurements as a prior already, with the offset added.

        The fit weighs them against its tracks alone, so they are taken out of it, the tracks'
        covariance is widened by `few` and by the offset of a site, and they are put back.
        """
        information = np.linalg.inv(fitted.covariance) - self.precision
        values, axes = np.linalg.eigh(information)
        information = (axes * np.maximum(values, 0.0)) @ axes.T / few
        # W = (I^-1 + D)^-1, also where I is singular.
        widening = np.eye(3) + information @ np.diag(walking.PLAUSIBLE_OFFSET**2)
        by_tracks = np.linalg.solve(widening, information)
        pull = np.linalg.solve(
            widening,
            information @ fitted.mean + self.precision @ (fitted.mean - self.mean) / few,
        )
        covariance = np.asarray(np.linalg.inv(by_tracks + self.precision), dtype=np.float64)
        return Normal(mean=covariance @ (pull + self.precision @ self.mean), covariance=covariance)


@dataclass(frozen=True, slots=True, kw_only=True)
class _End:
    """The end of a search, with the Gaussian there, and what it was made of.

    It is `enough` if there are enough groups, and boxes, different directions or a measured angle:
    the speeds of people who all walk one way leave tilt and roll to make up for one another.
    """

    log_posterior: float
    normal: Normal
    walking_groups: int
    enough: bool


def _end_of(
    tracks: Observations, start: Array, walk: WalkConfig, known: Normal, tape: _Tape
) -> _End | None:
    """Where Gauss-Newton ends, with the scatter of speeds as it is there; None out of reach."""
    candidate = start
    for _ in range(config.CALIBRATION_ROUNDS):
        pose = _pose_of(candidate)
        reference = of_levels(assumed_speed_reference(tracks, pose, walk))
        measured = measure_speeds(tracks.steps, candidate, pose.heading_rad)
        learned = learn(measured, reference.speeds, em_rounds=walking.EM_ROUNDS)
        speeds = replace(reference.speeds, components=learned.components)
        channels = channels_of(tracks, replace(reference, speeds=speeds), pose)
        fit = fit_pose(channels, FitStart(candidate=candidate), known)
        moved = float(np.abs(fit.candidate - candidate).max())
        candidate = fit.candidate
        if not config.LEAST_TILT_RAD <= candidate[0] <= config.MOST_TILT_RAD:
            return None
        if moved < config.CALIBRATED:
            break
    speeds_at_end = channels[0].measure(candidate=candidate, sloped=False)
    groups = count_walking_groups(speeds_at_end)
    few = max(1.0, walking.FEWEST_GROUPS / max(groups, 1))
    covariance = fit.covariance * walking.ASSUMED_INFLATION
    return _End(
        log_posterior=fit.log_likelihood / walking.ASSUMED_INFLATION,
        normal=tape.joined_with(Normal(mean=candidate, covariance=covariance), few),
        walking_groups=groups,
        enough=groups >= walking.FEWEST_GROUPS
        and (
            len(channels) > 1
            or bool(tape.precision[:2].any())
            or _across(speeds_at_end) >= config.LEAST_ACROSS
        ),
    )


def _across(speeds: Measured) -> float:
    """The share of steps (squared) that goes across the way that most people walk."""
    assert speeds.direction is not None
    walked = speeds.direction[speeds.valid & (speeds.value > math.log(walking.GROUP_STANDING_MPS))]
    if not len(walked):
        return 0.0
    return float(np.linalg.eigvalsh(walked.T @ walked / len(walked))[0])


def _mixed(ends: Sequence[_End]) -> SelfCalibration:
    """The moments of the mixture of all ends; the same end counts once."""
    best = max(ends, key=lambda end: end.log_posterior)
    different: list[_End] = []
    for end in sorted(ends, key=lambda end: -end.log_posterior):
        means = [other.normal.mean for other in different]
        if all((np.abs(end.normal.mean - mean) > walking.SAME_MODE).any() for mean in means):
            different.append(end)
    odds = np.exp([end.log_posterior - best.log_posterior for end in different])
    odds = odds / odds.sum()
    middle = np.sum([one * end.normal.mean for one, end in zip(odds, different, strict=True)], 0)
    covariance = np.zeros((3, 3))
    for one, end in zip(odds, different, strict=True):
        apart = end.normal.mean - middle
        covariance += one * (end.normal.covariance + np.outer(apart, apart))
    sd = np.sqrt(np.diag(covariance))
    found = (sd <= CONFIRMABLE_SD) & best.enough
    named = zip(PLANE_PARAMETERS, found, strict=True)
    return SelfCalibration(
        values=middle,
        covariance=covariance,
        identifiable=tuple(name for name, sure in named if sure),
        walking_groups=best.walking_groups,
        log_posterior=best.log_posterior,
    )


def _pose_of(candidate: Array) -> CameraPose:
    tilt_rad, roll_rad, log_height = (float(value) for value in candidate)
    return CameraPose(height_m=math.exp(log_height), tilt_rad=tilt_rad, roll_rad=roll_rad)
