"""The bias curve of a trained regressor's mean, learned on simulated sites."""

import math

import numpy as np
import numpy.typing as npt

from models.geometry.pose import CameraPose, plane_parameters_of
from models.regression.averaging import TrackPredictions, average_windows
from models.regression.network import PoseRegressor, predict_windows
from models.regression.recipe import TrainingPlan
from models.simulation.poses import PoseSet, random_poses
from models.simulation.walkers import Walks, simulate_walks
from models.tracks.trajectory import Windows
from studies.regressors.calibrated import (
    Calibration,
    fit_calibration,
    mean_plane_parameters,
    sampling_covariance,
)
from studies.simulation.crowds import FlowConfig
from studies.simulation.flows import simulate_sites

_SITES = 600
_PEOPLE = 60
_EVEN_SHARE = 0.25  # of the sites, where people walk anywhere as in the training
_FEWEST = 15  # tracks of a set; what sees less is left out


def learn_calibration(
    network: PoseRegressor, plan: TrainingPlan, flow: FlowConfig, sites: int = _SITES
) -> Calibration:
    """The curve from true to mean answered numbers over the plan's range of poses.

    Raises:
        ShapeError: too few sites see enough ground.
    """
    rng = np.random.default_rng([plan.seed, 3])
    poses = random_poses(plan.prior_pose, plan.recipe.spread, sites, rng)
    even = round(_EVEN_SHARE * sites)
    apart = np.arange(sites, dtype=np.int64)
    (walks,) = simulate_sites(
        plan.intrinsics, [poses.take(apart[even:])], _PEOPLE, flow, plan.walk, rng
    )
    anywhere = simulate_walks(
        plan.intrinsics, poses.take(np.repeat(apart[:even], _PEOPLE)), plan.walk, rng
    )
    true, means, scatter = [], [], []
    for seen_by, some, site_idx in (
        (poses.take(apart[even:]), walks, walks.pose_idx),
        (poses.take(apart[:even]), anywhere, anywhere.pose_idx // _PEOPLE),
    ):
        for site, predictions in _by_site(network, plan, some, site_idx):
            pose = _pose(plan.prior_pose, seen_by, site)
            true.append(plane_parameters_of(pose))
            means.append(mean_plane_parameters(predictions))
            scatter.append(sampling_covariance(predictions, site))
    prior = plane_parameters_of(plan.prior_pose)
    shape = (-1, 3)
    return fit_calibration(
        prior,
        np.array(true).reshape(shape),
        np.array(means).reshape(shape),
        np.array(scatter).reshape(-1, 3, 3),
    )


def _by_site(
    network: PoseRegressor, plan: TrainingPlan, walks: Walks, site_idx: npt.NDArray[np.int64]
) -> list[tuple[int, TrackPredictions]]:
    """Predictions of the network for each site's walks, for sites with enough of them."""
    windows = Windows(
        uv=walks.uv, lengths=walks.lengths, owner_idx=np.arange(len(walks), dtype=np.int64)
    )
    height_m, q = predict_windows(network, windows, plan)
    found = []
    for site in np.unique(site_idx):
        rows = np.flatnonzero(site_idx == site)
        if rows.size >= _FEWEST:
            _, predictions = average_windows(height_m[rows], q[rows], windows.owner_idx[rows])
            found.append((int(site), predictions))
    return found


def _pose(prior: CameraPose, poses: PoseSet, place: int) -> CameraPose:
    return CameraPose(
        height_m=float(poses.height_m[place]),
        tilt_rad=float(np.clip(poses.tilt_rad[place], -math.pi / 2, math.pi / 2)),
        roll_rad=float(poses.roll_rad[place]),
        heading_rad=prior.heading_rad,
    )
