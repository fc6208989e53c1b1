"""Recorded tracks on the ground as a pose has them, seen from above; up is where it looks."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from models.geometry.ground import ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.pages.drawings.picture import Ground, ground_of
from service.pages.drawings.svg_paths import Frame, path_data

_SIZE, _MARGIN = 640.0, 20.0


def tried_ground_svg(lens: Intrinsics, pose: CameraPose, tracks: Sequence[Array]) -> Markup:
    """A square map of what the camera sees, with feet (N, 2); empty where it sees no ground."""
    view = ground_of(lens, pose)
    if view is None:
        return Markup("")
    left, right = min(view.across_m[0], 0.0), max(view.across_m[1], 0.0)
    near, far = min(view.away_m[0], 0.0), view.away_m[1]
    scale = (_SIZE - 2 * _MARGIN) / max(right - left, far - near, 1e-6)
    middle = (left + right) / 2
    frame = Frame(left=0.0, top=0.0, right=_SIZE, bottom=_SIZE)

    def on_page(ground: Array) -> Array:
        local = (ground - view.foot_m) @ np.array([view.right, view.forward]).T
        across = _SIZE / 2 + (local[:, 0] - middle) * scale
        return np.stack([across, _SIZE - _MARGIN - (local[:, 1] - near) * scale], axis=-1)

    feet = [ground_from_pixel(lens, pose.rotation, pose.centre_m, uv)[0] for uv in tracks]
    drawn = path_data([on_page(walk) for walk in feet], frame)
    u, v = on_page(np.array([view.foot_m]))[0]
    size = _scale_words(view)
    return Markup(
        f'<svg class="picture" viewBox="0 0 {_SIZE:.0f} {_SIZE:.0f}" role="img" '
        f'aria-label="The ground from above; a square is {size}">'
        f'<path class="grid prior" d="{path_data([on_page(x) for x in view.lines()], frame)}"/>'
        f'<path class="track" d="{drawn}"/>'
        f'<circle class="foot" cx="{u:.1f}" cy="{v:.1f}" r="7"/></svg>'
    )


def _scale_words(view: Ground) -> str:
    return f"{view.spacing_m:g} m"
