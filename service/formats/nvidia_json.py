"""What a pose changes in a `calibration.json` of NVIDIA's Metropolis.

Source: NVIDIA VSS, "Calibration Schema", the fields of `sensors`.
"""

import json

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose


def nvidia_json(intrinsics: Intrinsics, pose: CameraPose, *, camera_id: str) -> str:
    """A patch for the sensor of the same id; what it does not name stays as it is in the file.

    That is of `calibrationType` cartesian, in metres of our world. Its lens is a pinhole: the
    matrices are of undistorted pixels. `homography` takes the ground to the picture.
    """
    extrinsic = np.column_stack([pose.rotation, pose.translation_m])
    projection = intrinsics.matrix @ extrinsic
    sensor = {
        "type": "camera",
        "id": camera_id,
        "coordinates": {"x": pose.x_m, "y": pose.y_m, "z": pose.height_m},
        "intrinsicMatrix": intrinsics.matrix.tolist(),
        "extrinsicMatrix": extrinsic.tolist(),
        "cameraMatrix": projection.tolist(),
        "homography": projection[:, [0, 1, 3]].tolist(),
    }
    return json.dumps({"sensors": [sensor]}, indent=1)
