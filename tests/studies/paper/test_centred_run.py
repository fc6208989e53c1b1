import numpy as np
import pytest

from models.geometry.pose import CameraPose
from models.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from models.regression.averaging import TrackPredictions, averaged_estimate
from studies.paper.centred_run import pose_of


def test_what_tracks_cannot_tell_is_the_priors():
    prior = CameraPose(height_m=5, tilt_rad=0.2, heading_rad=1.0, x_m=3.0, y_m=4.0)
    predictions = TrackPredictions(
        height_m=np.full(5, 6.0),
        quaternion_wxyz=quaternion_from_rotation(rotation_from_angles([0.4] * 5, 0.1, 0.9)),
    )
    estimate = averaged_estimate(predictions, seed=0)
    assert estimate.value.heading_rad == pytest.approx(0.9)
    pose = pose_of(estimate, prior)
    assert (pose.heading_rad, pose.x_m, pose.y_m) == (1.0, 3.0, 4.0)
    assert (pose.height_m, pose.tilt_rad, pose.roll_rad) == pytest.approx((6.0, 0.4, 0.1))
