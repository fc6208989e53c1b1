"""The cameras of a site from above, north up: what each sees, and how it stands."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from models.geometry.footprint import REACH, view_outline
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.pages.drawings.ground_plan import (
    HEIGHT_PX,
    SIZE_PX,
    Plan,
    north,
    plan_around,
    scale_bar,
)
from service.pages.drawings.svg_paths import path_data
from service.wording.language import _n

_SEEN = REACH / 2  # camera heights: of views that reach farther, none could be told apart
_NAMED = 40  # cameras: more names hide one another, and the list has them
_LONGEST = 24  # characters of a name
_RIGHT = 0.8  # of the paper, from where on names go to the left


@dataclass(frozen=True, slots=True, kw_only=True)
class SiteCamera:
    """A camera on the map: `now` where it looks by now, None where that is the prior pose.

    `shown` is the state that its page shows, `state` the word for it.
    """

    id: str
    name: str
    lens: Intrinsics
    prior: CameraPose
    now: CameraPose | None
    shown: str
    state: str


def site_map_svg(found: Sequence[SiteCamera]) -> Markup:
    """The map: each camera a link to its page, with its view, and the one it should have dashed."""
    if not found:
        return Markup("")
    views = {
        each.id: [
            view_outline(each.lens, pose, _SEEN * pose.height_m)
            for pose in (each.prior, each.now)
            if pose is not None
        ]
        for each in found
    }
    outlines = [outline for of_camera in views.values() for outline in of_camera]
    feet = np.array([each.prior.centre_m[:2] for each in found])
    plan = plan_around(np.concatenate([feet, *outlines]))
    named = len(found) <= _NAMED
    # Those that need nobody below those that do.
    order = sorted(found, key=lambda each: each.now is not None)
    parts = [_camera(plan, each, views[each.id], named=named) for each in order]
    label = _n(
        "The ground from above, +Y up, with {n} camera and what it sees.",
        "The ground from above, +Y up, with {n} cameras and what each sees.",
        len(found),
    )
    return Markup(
        f'<svg class="plan site" viewBox="0 0 {SIZE_PX:.0f} {HEIGHT_PX:.0f}" role="group" '
        f'aria-label="{label}">{"".join([*parts, north(), scale_bar(plan)])}</svg>'
    )


def _camera(plan: Plan, each: SiteCamera, views: Sequence[np.ndarray], *, named: bool) -> str:
    kinds = ["served"] if each.now is None else ["prior", "served"]
    drawn = "".join(
        f'<path class="view {kind}" d="{path_data([plan.on_paper(view)], plan.frame)}Z"/>'
        for kind, view in zip(kinds, views, strict=True)
        if len(view)
    )
    foot = each.prior.centre_m[None, :2]
    x, y = plan.on_paper(foot)[0]
    # From the camera to where its view begins, so that one sees whose it is.
    nearest = views[-1][np.argsort(np.linalg.norm(views[-1] - foot, axis=1))[:1]]
    if len(nearest):
        to = path_data([plan.on_paper(np.concatenate([foot, nearest]))], plan.frame)
        drawn += f'<path class="view leads" d="{to}"/>'
    name = each.name if len(each.name) <= _LONGEST else f"{each.name[: _LONGEST - 1]}…"
    left, anchor = (x - 9, "end") if x > _RIGHT * SIZE_PX else (x + 9, "start")
    words = (
        f'<text class="halo" text-anchor="{anchor}" x="{left:.1f}" y="{y - 7:.1f}">'
        f"{escape(name)}</text>"
    )
    return (
        f'<a href="/ui/cameras/{each.id}" class="{each.shown}" '
        f'aria-label="{escape(each.name)}: {escape(each.state)}">{drawn}'
        f'<circle class="camera" cx="{x:.1f}" cy="{y:.1f}" r="6"/>{words if named else ""}</a>'
    )
