"""The regressors as estimators of the protocol, trained once for each scene."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import PLANE_PARAMETERS, CameraPose, plane_parameters_of
from models.regression.averaging import average_windows, averaged_estimate
from models.regression.network import predict_windows
from models.regression.recipe import plan_training
from models.regression.training import train
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import Scene
from models.tracks.trajectory import Trajectory, choose_step_s, cut_windows
from studies.plane_estimate import PlaneEstimate
from studies.protocol.cases import Answer, Estimator, ProtocolCase, nothing_identifiable
from studies.regressors.calibrated import (
    calibrated_estimate,
    mean_plane_parameters,
    sampling_covariance,
)
from studies.regressors.calibration import learn_calibration
from studies.simulation.crowds import FlowConfig

# A number of which an answer is less sure than this is not identifiable.
_IDENTIFIABLE_SD = (math.radians(3), math.radians(3), 0.2)
# How far an estimator is usually off on a site for good: foot points, places of other speed.
SITE_BIAS_SD = (math.radians(1.5), math.radians(2.0), 0.15)

Tracks = Sequence[Trajectory]
Regressor = Callable[[Tracks], PlaneEstimate]


def prepare_regressors(
    scene: Scene,
    *,
    seed: int,
    epochs: int | None = None,
    on_progress: Callable[[float], None] = lambda _: None,
) -> dict[str, Estimator]:
    """The estimators of a scene's camera, trained at its true pose: the prior of every case.

    `averaged` and `calibrated` answer from the tracks alone; `averaged_reference` and
    `calibrated_reference` also use the case's reference tracks. `epochs` replaces those of the
    training; `on_progress` gets the share that is done.

    Raises:
        CalibrationError: the camera sees no ground.
    """
    step_s = choose_step_s([track.trajectory for track in scene.tracks])
    walk = WalkConfig(step_s=step_s)
    plan = plan_training(
        intrinsics=scene.intrinsics,
        prior_pose=scene.true_pose,
        recipe_name="default",
        walk=walk,
        seed=seed,
        epochs=epochs,
    )
    network, _ = train(plan, lambda at: on_progress(at.step / at.steps))
    calibration = learn_calibration(network, plan, FlowConfig())

    def averaged(tracks: Tracks) -> PlaneEstimate:
        windows = cut_windows(tracks, scene.intrinsics, step_s)
        height_m, q = predict_windows(network, windows, plan)
        _, predictions = average_windows(height_m, q, windows.owner_idx)
        count = averaged_estimate(predictions, seed).tracks  # refuses too few
        return PlaneEstimate(
            values=mean_plane_parameters(predictions),
            covariance=sampling_covariance(predictions, seed),
            tracks=count,
        )

    def calibrated(tracks: Tracks) -> PlaneEstimate:
        windows = cut_windows(tracks, scene.intrinsics, step_s)
        height_m, q = predict_windows(network, windows, plan)
        _, predictions = average_windows(height_m, q, windows.owner_idx)
        return calibrated_estimate(predictions, calibration, seed)

    estimators: dict[str, Estimator] = {
        "averaged": lambda case: _answer(averaged(case.seen)),
        "calibrated": lambda case: _answer(calibrated(case.seen)),
        "averaged_reference": lambda case: _with_offset(averaged, case),
        "calibrated_reference": lambda case: _with_offset(calibrated, case),
    }
    return {name: _declaring(estimator) for name, estimator in estimators.items()}


def _declaring(estimator: Estimator) -> Estimator:
    """An estimator that answers too few tracks with the prior pose, and that it knows nothing."""

    def answer(case: ProtocolCase) -> Answer:
        try:
            return estimator(case)
        except TooFewTrajectoriesError:
            return nothing_identifiable(case)

    return answer


def _with_offset(regressor: Regressor, case: ProtocolCase) -> Answer:
    prior: CameraPose = case.prior_pose
    return _answer(without_offset(regressor(case.seen), regressor(case.reference), prior))


def without_offset(
    estimate: PlaneEstimate, reference: PlaneEstimate, prior: CameraPose
) -> PlaneEstimate:
    """The estimate less what the estimator was off while the pose was known to be the prior.

    The offset is `reference - prior`, shrunk by its own uncertainty: of a reference that knows
    nothing nothing is taken off. What stays unknown of it is added to the covariance.
    """
    bias = np.diag(np.square(SITE_BIAS_SD))
    gain = bias @ np.linalg.inv(bias + reference.covariance)
    offset = gain @ (reference.values - plane_parameters_of(prior))
    left = bias - gain @ bias
    return PlaneEstimate(
        values=estimate.values - offset,
        covariance=estimate.covariance + (left + left.T) / 2,
        tracks=estimate.tracks,
    )


def _answer(estimate: PlaneEstimate) -> Answer:
    sd = np.sqrt(np.diag(estimate.covariance))
    known = zip(PLANE_PARAMETERS, sd <= _IDENTIFIABLE_SD, strict=True)
    return Answer(
        values=estimate.values,
        covariance=estimate.covariance,
        tracks=estimate.tracks,
        identifiable=tuple(name for name, is_known in known if is_known),
    )
