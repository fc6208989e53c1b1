"""A site: how people walk before a camera that stands at its prior pose, learned and kept."""

import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from models.errors import CheckpointError
from models.monitoring.chart import chart_from_bytes, chart_to_bytes
from models.paths.reference import paths_from_bytes, paths_to_bytes
from models.pose import CameraSite, learn_site, observe
from models.tracks.trajectory import by_end
from models.walking.speed_reference import reference_from_bytes, reference_to_bytes
from surefoot.camera import Camera, camera_of
from surefoot.tracks import Track

_CAMERA, _WALKING, _PATHS, _CHART = "camera.json", "walking", "paths", "chart"


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A camera and what was learned of the people before it."""

    camera: Camera
    model: CameraSite

    def save(self, path: str | Path) -> None:
        """Write it to a file, for `read_site`."""
        with zipfile.ZipFile(path, "w") as file:
            file.writestr(_CAMERA, self.camera.as_json())
            file.writestr(_WALKING, reference_to_bytes(self.model.speed_reference))
            if self.model.paths is not None:
                file.writestr(_PATHS, paths_to_bytes(self.model.paths))
            if self.model.chart is not None:
                file.writestr(_CHART, chart_to_bytes(self.model.chart))


def learn(camera: Camera, tracks: Sequence[Track], *, seed: int = 0) -> Site:
    """The site of tracks that were seen while the camera stood at its prior pose.

    Where people walk, and with it the heading, is learned of 12 walking groups at least; some 200
    people are a good reference.

    Args:
        camera: at its prior pose.
        tracks: in any order.
        seed: of what is drawn.

    Raises:
        TooFewTrajectoriesError: fewer than 5 people walk.
    """
    prior = camera.prior_pose.in_radians
    observed = observe(by_end(tracks), camera.intrinsics, prior)
    return Site(camera=camera, model=learn_site(observed, camera.intrinsics, prior, seed=seed))


def read_site(path: str | Path) -> Site:
    """The site that `Site.save` wrote.

    Raises:
        CheckpointError: the file is missing or damaged, or of another release.
    """
    try:
        with zipfile.ZipFile(path) as file:
            camera = camera_of(json.loads(file.read(_CAMERA)))
            parts = {name: file.read(name) for name in file.namelist()}
            walking = reference_from_bytes(parts[_WALKING])
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{path}: no site of ours: {error}") from error
    paths, chart = parts.get(_PATHS), parts.get(_CHART)
    model = CameraSite(
        intrinsics=camera.intrinsics,
        prior=camera.prior_pose.in_radians,
        speed_reference=walking,
        paths=None if paths is None else paths_from_bytes(paths),
        chart=None if chart is None else chart_from_bytes(chart),
    )
    return Site(camera=camera, model=model)
