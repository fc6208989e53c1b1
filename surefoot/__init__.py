"""Surefoot in Python: learn how people walk before a camera, then tell whether it has moved.

    camera = surefoot.read_camera("camera.json")
    tracks = surefoot.read_tracks("tracks.txt", frame_rate_hz=25)
    site = surefoot.learn(camera, tracks[:200])
    result = surefoot.estimate(site, tracks[200:])
    result.moved, result.why, result.pose, result.intervals(0.9)

Angles are in degrees here, as over HTTP: tilt is positive looking down, roll with the right side
lower, heading clockwise from north (world +Y). Lengths are metres.
"""

from models.errors import CalibrationError
from surefoot.camera import Camera, Pose, read_camera
from surefoot.ground import ellipses, ground, image
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
