"""Arrays as bytes, and records as the values of `models/`."""

from dataclasses import replace

import numpy as np

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose, PoseParameters
from models.geometry.rotation import Array
from models.geometry.upright import tops_of_boxes, uncut
from models.monitoring.verdict import Drift
from models.tracks.trajectory import Trajectory
from service.store.cameras import CameraRecord, PriorPoseRecord
from service.store.stored_tracks import StoredTrack


def pack(array: Array) -> bytes:
    """Little-endian float64, row by row."""
    return np.ascontiguousarray(array, dtype="<f8").tobytes()


def unpack(data: bytes, columns: int) -> Array:
    """The array (N, columns) of `pack`."""
    return np.frombuffer(data, dtype="<f8").reshape(-1, columns).astype(np.float64)


def trajectory_of(record: StoredTrack) -> Trajectory:
    """The foot points of a stored track."""
    points = unpack(record.points, 3)
    return Trajectory(time_s=points[:, 0], uv=points[:, 1:])


def seen_of(record: StoredTrack, feet: Trajectory, intrinsics: Intrinsics) -> Trajectory:
    """The feet of a stored track with the upper edges of its boxes or its heads, where it has any.

    Who has a head is as tall as it is high, where the picture's border does not cut it.
    """
    if record.heads is not None:
        heads = unpack(record.heads, 2)
        tops = np.where(uncut(intrinsics, heads), heads[:, 1], np.nan)
        return replace(feet, top_v=tops, head_uv=heads)
    if record.boxes is None:
        return feet
    return replace(feet, top_v=tops_of_boxes(intrinsics, unpack(record.boxes, 4)))


def intrinsics_of(record: CameraRecord) -> Intrinsics:
    """The lens of a stored camera."""
    k1, k2, p1, p2, k3 = record.distortion
    return Intrinsics(
        width=record.width,
        height=record.height,
        fx=record.fx,
        fy=record.fy,
        cx=record.cx,
        cy=record.cy,
        distortion=(k1, k2, p1, p2, k3),
    )


def pose_of_prior(record: PriorPoseRecord) -> CameraPose:
    """A stored prior pose."""
    return CameraPose(
        height_m=record.height_m,
        tilt_rad=record.tilt_rad,
        roll_rad=record.roll_rad,
        heading_rad=record.heading_rad,
        x_m=record.x_m,
        y_m=record.y_m,
    )


def identifiable_drift(drift: Drift) -> dict[str, float | None]:
    """The identifiable drift as an alert keeps it; None where the tracks leave it open."""
    angle_rad = drift.angle_rad if drift.turned else None
    return {**_where_identifiable(drift.by, drift.identifiable), "angle_rad": angle_rad}


def identifiable_sd(drift: Drift) -> dict[str, float | None]:
    """The standard deviations of what is identifiable, likewise."""
    return _where_identifiable(drift.sd, drift.identifiable)


def _where_identifiable(
    parameters: PoseParameters, identifiable: tuple[str, ...]
) -> dict[str, float | None]:
    return {
        "height_m": parameters.height_m if "height" in identifiable else None,
        "tilt_rad": parameters.tilt_rad if "tilt" in identifiable else None,
        "roll_rad": parameters.roll_rad if "roll" in identifiable else None,
        "heading_rad": parameters.heading_rad if "heading" in identifiable else None,
    }
