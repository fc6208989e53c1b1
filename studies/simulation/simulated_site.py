"""A simulated site of a study: its camera and lanes are drawn, and its reference is learned."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.errors import DegenerateGeometryError, TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.pose import CameraSite, Observations, learn_site, observe
from models.pose.pose_fit import FusedEstimate
from models.tracks.trajectory import Trajectory, by_end
from studies.protocol.served import served_pose
from studies.simulation.lanes import Lane, SiteConfig, draw_lanes, walk_site

# Of the reference: a site's speeds are known by then, and learning them from more is slow.
SPEED_TRACKS = 400
_MOST_DRAWS = 20
_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSite:
    """A camera at its prior pose, and how the people before it walk."""

    intrinsics: Intrinsics
    prior: CameraPose
    lanes: tuple[Lane, ...]
    config: SiteConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedSite:
    """A simulated site with what its reference tracks showed: learned once."""

    simulated: SimulatedSite
    site: CameraSite

    def fused(self, tracks: Observations) -> FusedEstimate:
        """The pose that would be served of tracks."""
        return served_pose(tracks, self.site).fused


def draw_simulated_site(rng: np.random.Generator) -> SimulatedSite:
    """A street camera 4 to 9 m high with two to four lanes before it.

    Raises:
        DegenerateGeometryError: no lane could be drawn that is seen, in 20 draws.
    """
    for _ in range(_MOST_DRAWS):
        focal = float(rng.uniform(900, 1400))
        lens = Intrinsics(width=1280, height=720, fx=focal, fy=focal, cx=639.5, cy=359.5)
        prior = CameraPose(
            height_m=float(rng.uniform(4, 9)),
            tilt_rad=math.radians(rng.uniform(14, 28)),
            roll_rad=math.radians(rng.uniform(-2, 2)),
            heading_rad=float(rng.uniform(-math.pi, math.pi)),
        )
        config = SiteConfig(
            lanes=int(rng.integers(2, 5)),
            speed_mean_mps=float(rng.uniform(1.1, 1.45)),
            aside_m=float(rng.uniform(0.5, 1.5)),
        )
        lanes = draw_lanes(lens, prior, config, rng)
        try:
            for lane in lanes:
                walk_site(lens, prior, [lane], config, 1, rng)
        except DegenerateGeometryError:
            continue
        return SimulatedSite(intrinsics=lens, prior=prior, lanes=tuple(lanes), config=config)
    raise DegenerateGeometryError(f"lanes: none are seen in {_MOST_DRAWS} draws")


def learn_simulated_site(simulated: SimulatedSite, reference: Observations) -> LearnedSite:
    """Site learned of reference tracks.

    Raises:
        TooFewTrajectoriesError: fewer than 12 people walk.
    """
    site = learn_site(
        reference,
        simulated.intrinsics,
        simulated.prior,
        seed=_SEED,
        speed_tracks=SPEED_TRACKS,
        chart=False,
    )
    if site.paths is None:
        raise TooFewTrajectoriesError("tracks: 12 that walk are needed for a flow map")
    return LearnedSite(simulated=simulated, site=site)


def seen_from(
    simulated: SimulatedSite, pose: CameraPose, count: int, rng: np.random.Generator
) -> Observations:
    """Observations of `count` tracks of a simulated site's people, the camera at a pose.

    Raises:
        DegenerateGeometryError: hardly any walk is seen from the pose.
    """
    tracks = walk_site(simulated.intrinsics, pose, simulated.lanes, simulated.config, count, rng)
    return observe_feet(tracks, simulated.intrinsics, simulated.prior)


def observe_feet(
    tracks: Sequence[Trajectory], intrinsics: Intrinsics, prior: CameraPose
) -> Observations:
    """Observations of simulated feet, in the order that the service sees: of the tracks' ends.

    Simulated boxes are truer than any detector's, and left out.
    """
    return observe(by_end(replace(track, top_v=None) for track in tracks), intrinsics, prior)
