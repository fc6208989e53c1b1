"""The site of a camera, and learning it: how people walk before it, where, and what is usual."""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, array_of
from models.geometry.rotation import Array
from models.monitoring.chart import DriftChart
from models.monitoring.chart_learning import learn_chart
from models.monitoring.group_scores import Usual
from models.monitoring.slow_drift import SlowDriftLog
from models.paths.folds import ChosenBandwidths, fold_maps
from models.paths.reference import PathReference, learn_paths
from models.simulation.walkers import WalkConfig
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.reference_learning import learn_speed_reference
from models.walking.speed_reference import SpeedReference, assumed_speed_reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """The first map and chart of a reference, which never grow, and whole days scored by them.

    `days` is None before the first whole day. The camera has been stationary since `from_s` but for
    a slow drift; None means since the reference.
    """

    paths: PathReference
    chart: DriftChart
    days: SlowDriftLog | None = None
    from_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSite:
    """A camera at its prior pose, and what is known of the people before it.

    `speed_reference` is how they walk, learned or assumed. `paths` are where they do and `chart`
    how their scores scatter; None where too few people walked to learn it. `baseline` is the first
    version of both; None of a site without one.
    """

    intrinsics: Intrinsics
    prior: CameraPose
    speed_reference: SpeedReference
    paths: PathReference | None = None
    chart: DriftChart | None = None
    baseline: Baseline | None = None

    @property
    def learned(self) -> bool:
        """True if anything of it was learned; else a walking speed is assumed, and no more."""
        return self.speed_reference.tracks > 0

    def usual(self, paths: PathReference, chart: DriftChart) -> Usual:
        """The scores that its paths and its chart take for usual, seen from the prior pose."""
        return Usual(
            prior=self.prior,
            speed_reference=chart.speed_reference,
            paths=paths.model(self.intrinsics),
        )


_USUAL_WALK = WalkConfig()


def learn_site(
    tracks: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    walk: WalkConfig = _USUAL_WALK,
    *,
    seed: int = 0,
    speed_reference: SpeedReference | None = None,
    weights: Array | None = None,
    speed_tracks: int | None = None,
    chart: bool = True,
    chosen: ChosenBandwidths | None = None,
) -> CameraSite:
    """The site of tracks at the prior pose; no map and no chart where fewer than 12 groups walk.

    A map that grows is learned anew of all tracks that are known to be of the prior pose, older
    ones by less weight; how people walk there stays what the reference said, as an anchor.

    Tracks are in the order of their ends; `weights` (tracks,) are what each counts for in the map,
    0 to 1, else 1. How people walk is learned of so many `speed_tracks` first ones, of all unless
    given, not at all where a `speed_reference` is. The `chart` takes as long as all the rest.
    Bandwidths that were `chosen` before are kept for some hours.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step, and how people walk is not known.
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(tracks)
    if speed_reference is None:
        count = tracks.tracks if speed_tracks is None else min(speed_tracks, tracks.tracks)
        first = of_tracks(tracks, np.arange(count))
        speed_reference = learn_speed_reference(first, prior, walk, seed)
    site = CameraSite(intrinsics=intrinsics, prior=prior, speed_reference=speed_reference)
    folds = fold_maps(tracks, intrinsics, array_of(prior), seed, weights, chosen)
    if folds is None:
        return site
    return replace(
        site,
        paths=learn_paths(tracks, intrinsics, prior, seed, weights, folds),
        chart=learn_chart(tracks, prior, speed_reference, folds, seed) if chart else None,
    )


def assume_site(
    tracks: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    walk: WalkConfig = _USUAL_WALK,
) -> CameraSite:
    """A site of which nothing is known yet but an assumed walking speed.

    Raises:
        TooFewTrajectoriesError: fewer than 5 tracks with a step.
    """
    speed_reference = assumed_speed_reference(tracks, prior, walk)
    return CameraSite(intrinsics=intrinsics, prior=prior, speed_reference=speed_reference)
