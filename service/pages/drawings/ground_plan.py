"""The ground from above, to scale: a camera, its view by two poses, people.

World +Y is up; of a pose that is tried, up is where it looks.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from models.geometry.footprint import REACH, view_outline
from models.geometry.ground import Misplacement, ground_from_pixel
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.pages.drawings.picture import Overlay, ground_of
from service.pages.drawings.svg_paths import Frame, path_data, svg
from service.wording.language import _, number

SIZE_PX = 640.0
_MARGIN_PX, _TRIED_MARGIN_PX = 18.0, 20.0
_STRIP_PX = 26.0  # below the ground, for the scale and +Y
HEIGHT_PX = 470.0
_FARTHEST = 30.0
_SCALES_M = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A piece of the world on paper: its left upper corner, and how many pixels a metre is."""

    left_m: float
    top_m: float
    px_per_m: float

    def on_paper(self, ground_m: Array) -> Array:
        """Where points of the ground (N, 2) lie, in pixels from the left upper corner."""
        return (ground_m - (self.left_m, self.top_m)) * (self.px_per_m, -self.px_per_m)

    @property
    def frame(self) -> Frame:
        """The edges of the paper."""
        return Frame(left=0.0, top=0.0, right=SIZE_PX, bottom=HEIGHT_PX)


def ground_plan_svg(
    lens: Intrinsics,
    overlays: Sequence[Overlay],
    tracks: Sequence[Array],
    misplaced: Sequence[Misplacement] = (),
    *,
    label: str,
) -> Markup:
    """The ground from above.

    Args:
        lens: of the camera.
        overlays: poses whose view is drawn, the last one on top; it says where people were.
        tracks: pixels of feet (N, 2), a track each.
        misplaced: drawn as strokes from where people stand to where the prior pose puts them.
        label: what a screen reader says of it.
    """
    pose = overlays[-1].pose
    walked = [ground_from_pixel(lens, pose.rotation, pose.centre_m, track)[0] for track in tracks]
    reach_m = _reach_m(pose, walked)
    views = [(each.kind, view_outline(lens, each.pose, reach_m)) for each in overlays]
    cameras = np.array([each.pose.centre_m[:2] for each in overlays])
    plan = plan_around(np.concatenate([cameras, *(outline for _, outline in views)]))
    parts = [
        f'<path class="view {kind}" d="{path_data([plan.on_paper(outline)], plan.frame)}Z"/>'
        for kind, outline in views
        if len(outline)
    ]
    drawn = path_data((plan.on_paper(track) for track in walked), plan.frame)
    parts.append(f'<path class="track" d="{drawn}"/>')
    parts += [_stroke(plan, each) for each in misplaced]
    parts += [_camera(plan, pose), north(), scale_bar(plan)]
    return svg("picture plan", f"0 0 {SIZE_PX:.0f} {HEIGHT_PX:.0f}", label, parts)


def tried_ground_svg(lens: Intrinsics, pose: CameraPose, tracks: Sequence[Array]) -> Markup:
    """A square map of what the camera sees, with feet (N, 2); empty where it sees no ground."""
    view = ground_of(lens, pose)
    if view is None:
        return Markup("")
    left, right = min(view.across_m[0], 0.0), max(view.across_m[1], 0.0)
    near, far = min(view.away_m[0], 0.0), view.away_m[1]
    scale = (SIZE_PX - 2 * _TRIED_MARGIN_PX) / max(right - left, far - near, 1e-6)
    middle = (left + right) / 2
    frame = Frame(left=0.0, top=0.0, right=SIZE_PX, bottom=SIZE_PX)

    def on_page(ground: Array) -> Array:
        local = (ground - view.foot_m) @ np.array([view.right, view.forward]).T
        across = SIZE_PX / 2 + (local[:, 0] - middle) * scale
        return np.stack(
            [across, SIZE_PX - _TRIED_MARGIN_PX - (local[:, 1] - near) * scale], axis=-1
        )

    feet = [ground_from_pixel(lens, pose.rotation, pose.centre_m, uv)[0] for uv in tracks]
    drawn = path_data([on_page(walk) for walk in feet], frame)
    u, v = on_page(np.array([view.foot_m]))[0]
    parts = [
        f'<path class="grid prior" d="{path_data([on_page(x) for x in view.lines()], frame)}"/>',
        f'<path class="track" d="{drawn}"/>',
        f'<circle class="foot" cx="{u:.1f}" cy="{v:.1f}" r="7"/>',
    ]
    label = _("The ground from above; a square is {m:g} m", m=view.spacing_m)
    return svg("picture", f"0 0 {SIZE_PX:.0f} {SIZE_PX:.0f}", label, parts)


def plan_around(points_m: Array) -> Plan:
    """The paper that shows some points of the ground (N, 2), all of them."""
    (left, low), (right, high) = points_m.min(0).tolist(), points_m.max(0).tolist()
    wide, tall = SIZE_PX - 2 * _MARGIN_PX, HEIGHT_PX - 2 * _MARGIN_PX - _STRIP_PX
    px_per_m = min(wide / max(right - left, 1.0), tall / max(high - low, 1.0))
    return Plan(
        left_m=(left + right - SIZE_PX / px_per_m) / 2,
        top_m=(low + high + (HEIGHT_PX - _STRIP_PX) / px_per_m) / 2,
        px_per_m=px_per_m,
    )


def _reach_m(pose: CameraPose, walked: Sequence[Array]) -> float:
    if not walked:
        return REACH * pose.height_m
    away = np.linalg.norm(np.concatenate(walked) - pose.centre_m[:2], axis=1)
    away = away[np.isfinite(away)]
    if not len(away):
        return REACH * pose.height_m
    return float(min(1.15 * np.quantile(away, 0.98), _FARTHEST * pose.height_m))


def _stroke(plan: Plan, each: Misplacement) -> str:
    stands = plan.on_paper(np.array([each.stands_m]))[0]
    x, y = stands
    words = f"{each.distance_m:.0f} m"
    inside = 0 < x < SIZE_PX and 0 < y < HEIGHT_PX
    if not inside:
        return ""
    line = ""
    if each.placed_m is not None:
        both = np.array([stands, plan.on_paper(np.array([each.placed_m]))[0]])
        line = f'<path class="off" d="{path_data([both], plan.frame)}"/>'
    return (
        f'{line}<circle class="stands" cx="{x:.1f}" cy="{y:.1f}" r="4"/>'
        f'<text class="halo" x="{x + 8:.1f}" y="{y + 4:.1f}">{words}</text>'
    )


def _camera(plan: Plan, pose: CameraPose) -> str:
    (x, y), ahead = plan.on_paper(pose.centre_m[None, :2])[0], math.degrees(pose.heading_rad)
    return (
        f'<g class="camera" transform="translate({x:.1f} {y:.1f}) rotate({ahead:.1f})">'
        '<path d="M-7 8H7V-4L4 -8H-4L-7 -4Z"/></g>'
    )


def north() -> str:
    """The arrow that says where +Y is."""
    x, y = SIZE_PX - 14, HEIGHT_PX - 8
    return (
        f'<path class="mark" d="M{x:.0f} {y}V{y - 22}M{x - 5:.0f} {y - 14}L{x:.0f} {y - 22}'
        f'L{x + 5:.0f} {y - 14}"/><text class="halo" x="{x - 9:.0f}" y="{y - 4}" '
        'text-anchor="end">+Y</text>'
    )


def scale_bar(plan: Plan) -> str:
    """A length on the ground, as long as fits well."""
    fits = [length for length in _SCALES_M if length * plan.px_per_m <= 0.28 * SIZE_PX]
    length = fits[-1] if fits else _SCALES_M[0]
    left, y, wide = 12.0, HEIGHT_PX - 8, length * plan.px_per_m
    return (
        f'<path class="mark" d="M{left} {y - 5:.1f}V{y:.1f}H{left + wide:.1f}V{y - 5:.1f}"/>'
        f'<text class="halo" x="{left + wide + 8:.1f}" y="{y:.1f}">{number(length, "g")} m</text>'
    )
