"""The picture plane drawn to scale: horizon and ground grid of poses, tracks. Values in, SVG out.

Colours and strokes are of `style.css`: the prior pose is dashed blue, the served one solid orange.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from markupsafe import Markup, escape

from models.geometry.ground import (
    ground_from_pixel,
    horizon_pixels,
    picture_lattice,
    pixel_from_ground,
)
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.pages.drawings.svg_paths import Frame, path_data, svg
from service.wording.language import _

_SPACINGS_M = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
_LINES = 20  # about so many lie across the view
_FAR = 12.0  # heights away, where a grid would be mere noise
_ALONG = 61  # points of a line, so that it bends with the lens
_LATTICE = 41


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """A grid on the ground: squares of `spacing_m`, in the axes of the view that it was made for.

    `across_m` and `away_m` are its bounds to the right of and away from the foot of the camera.
    """

    foot_m: tuple[float, float]
    right: tuple[float, float]
    forward: tuple[float, float]
    spacing_m: float
    across_m: tuple[float, float]
    away_m: tuple[float, float]

    def lines(self) -> list[Array]:
        """Its lines, each (N, 2) on the ground."""
        across = _steps(self.across_m, self.spacing_m)
        away = _steps(self.away_m, self.spacing_m)
        wide = np.linspace(across[0], across[-1], _ALONG)
        # Denser near the camera, where a metre is many pixels.
        near = away[0] + (away[-1] - away[0]) * np.linspace(0.0, 1.0, _ALONG) ** 2
        lines = [np.stack([wide, np.full(_ALONG, at)], axis=-1) for at in away]
        lines += [np.stack([np.full(_ALONG, at), near], axis=-1) for at in across]
        axes = np.array([self.right, self.forward])
        return [line @ axes + self.foot_m for line in lines]


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlay:
    """A pose to draw, and as what: the one that was trusted, or the one that is served."""

    pose: CameraPose
    kind: Literal["prior", "served"]


def ground_of(lens: Intrinsics, pose: CameraPose) -> Ground | None:
    """A grid over the ground that a camera sees, in whole squares; None where it sees none.

    Draw it by several poses to see how they differ: it stays where it is in the world.
    """
    ground, hits = ground_from_pixel(
        lens, pose.rotation, pose.centre_m, picture_lattice(lens, _LATTICE)
    )
    if not hits.any():
        return None
    level = pose.rotation[2, :2]
    # Straight down there is no forward; the picture's up is one.
    forward = level if np.hypot(*level) > 1e-6 else -pose.rotation[1, :2]
    forward = forward / np.hypot(*forward)
    right = np.array([forward[1], -forward[0]])
    local = (ground[hits] - pose.centre_m[:2]) @ np.stack([right, forward], axis=-1)
    near = local[np.hypot(local[:, 0], local[:, 1]) < _FAR * pose.height_m]
    local = near if len(near) else local[[np.argmin(np.hypot(local[:, 0], local[:, 1]))]]
    (left, begins), (to, ends) = local.min(0).tolist(), local.max(0).tolist()
    span = max(to - left, ends - begins, 0.1 * pose.height_m)
    spacing = min(_SPACINGS_M, key=lambda each: abs(np.log(each * _LINES / span)))
    return Ground(
        foot_m=(pose.x_m, pose.y_m),
        right=(float(right[0]), float(right[1])),
        forward=(float(forward[0]), float(forward[1])),
        spacing_m=spacing,
        across_m=(left, to),
        away_m=(begins, ends),
    )


def horizon_path(lens: Intrinsics, pose: CameraPose) -> str:
    """The horizon in a picture, as path data; empty where it is not in it."""
    return path_data([horizon_pixels(lens, pose)[0]], picture_frame(lens))


def grid_path(lens: Intrinsics, pose: CameraPose, ground: Ground) -> str:
    """A grid on the ground as a pose sees it, as path data."""
    seen = (
        pixel_from_ground(lens, pose.rotation, pose.centre_m, line)[0] for line in ground.lines()
    )
    return path_data(seen, picture_frame(lens))


def picture_svg(
    lens: Intrinsics,
    overlays: Sequence[Overlay],
    tracks: Sequence[Array] = (),
    before: Sequence[Array] = (),
    *,
    label: str,
    ground: Ground | None = None,
    snapshot_url: str | None = None,
    over: Sequence[str] = (),
) -> Markup:
    """The picture plane with the horizon and the grid of each pose, and foot points (N, 2).

    Args:
        lens: its size is that of the drawing.
        overlays: drawn in this order.
        tracks: pixels of feet, a track each.
        before: those of before the camera moved.
        label: what a screen reader says of it.
        ground: the grid; that of the first overlay if not given.
        snapshot_url: a still image to lie behind it.
        over: SVG that lies over the grids, below people.
    """
    if ground is None and overlays:
        ground = ground_of(lens, overlays[0].pose)
    parts, seen = [], not overlays
    if snapshot_url is not None:
        parts.append(
            f'<image href="{escape(snapshot_url)}" x="-0.5" y="-0.5" width="{lens.width}" '
            f'height="{lens.height}" preserveAspectRatio="none"/>'
        )
    for overlay in overlays:
        if ground is not None:
            drawn = grid_path(lens, overlay.pose, ground)
            parts.append(f'<path class="grid {overlay.kind}" d="{drawn}"/>')
            seen = seen or bool(drawn)
        drawn = horizon_path(lens, overlay.pose)
        parts.append(f'<path class="horizon {overlay.kind}" d="{drawn}"/>')
        seen = seen or bool(drawn)
    if not seen:
        words = escape(_("nothing but sky"))
        parts.append(
            f'<text class="nothing" x="{lens.width / 2:.0f}" y="{lens.height / 2:.0f}" '
            f'text-anchor="middle" font-size="{lens.width / 24:.0f}">{words}</text>'
        )
    parts += over
    for kind, some in (("track then", before), ("track now" if before else "track", tracks)):
        if some:
            drawn = path_data(some, picture_frame(lens))
            parts.append(f'<path class="{kind}" d="{drawn}"/>')
    return svg("picture", f"-0.5 -0.5 {lens.width} {lens.height}", label, parts)


def picture_frame(lens: Intrinsics) -> Frame:
    """The edges of a picture: half a pixel beyond the centres of the outermost pixels."""
    return Frame(left=-0.5, top=-0.5, right=lens.width - 0.5, bottom=lens.height - 0.5)


def _steps(bounds: tuple[float, float], spacing: float) -> Array:
    first, last = np.floor(bounds[0] / spacing), np.ceil(bounds[1] / spacing)
    return np.arange(first, last + 1) * spacing
