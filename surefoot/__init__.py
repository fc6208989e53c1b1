"""Surefoot in Python: learn how people walk before a camera, then tell whether it has moved.

    camera = surefoot.read_camera("camera.json")
    tracks = surefoot.read_tracks("tracks.txt", frame_rate_hz=25)
    site = surefoot.learn(camera, tracks[:200])
    result = surefoot.estimate(site, tracks[200:])
    result.moved, result.why, result.pose, result.intervals(0.9)

Angles are in degrees here, as over HTTP: tilt is positive looking down, roll with the right side
lower, heading clockwise from north (world +Y). Lengths are metres.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from models.errors import CalibrationError
    from surefoot.camera import Camera, Pose
    from surefoot.camera_file import read_camera
    from surefoot.ground_points import ellipses, ground, image
    from surefoot.result import Result, estimate
    from surefoot.site import Site, learn, read_site
    from surefoot.tracks import Track, read_tracks

__all__ = [
    "CalibrationError",
    "Camera",
    "Pose",
    "Result",
    "Site",
    "Track",
    "ellipses",
    "estimate",
    "ground",
    "image",
    "learn",
    "read_camera",
    "read_site",
    "read_tracks",
]


def __getattr__(name: str) -> Any:
    """A name of those above, when it is asked for.

    The client, the bridge and the commands that ask a service do without numpy: a second of
    starting, and 80 MB.
    """
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from models import errors
    from surefoot import camera, camera_file, ground_points, result, site, tracks

    parts = (errors, camera, camera_file, ground_points, result, site, tracks)
    return next(vars(part)[name] for part in parts if name in vars(part))
