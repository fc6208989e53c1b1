"""The drawings of a camera's page: the picture plane and the ground, by both poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from models.geometry.ground import Misplacement
from models.geometry.rotation import Array
from models.tracks.trajectory import Trajectory
from service.cameras.cameras import CameraView
from service.cameras.poses import PoseView
from service.cameras.zones import ZonesView
from service.pages.drawings.ground_plan import ground_plan_svg
from service.pages.drawings.picture import Overlay, ground_of, horizon_path, picture_svg
from service.pages.drawings.zones import zone_parts
from service.store.cameras import SnapshotRecord
from service.wording.language import N_, _

_POINTS = 24
_OF = {
    (): N_("no pose, which nobody knows"),
    ("prior",): N_("the prior pose"),
    ("served",): N_("the proposed pose"),
    ("prior", "served"): N_("the prior pose, dashed, and the served pose, solid"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraDrawings:
    """Two SVGs, and what has to be said of them."""

    picture: Markup
    plan: Markup
    spacing_m: float | None
    people: int
    before: int
    two_poses: bool
    horizon: bool


def draw_camera(
    camera: CameraView,
    served: PoseView,
    tracks: Sequence[Trajectory],
    before: Sequence[Trajectory],
    misplaced: Sequence[Misplacement],
    still: SnapshotRecord | None,
    zones: ZonesView,
) -> CameraDrawings:
    """The picture plane and the ground from above, with the newest tracks.

    The served pose is drawn where the tracks tell one; until then there is the prior pose alone, or
    the one that is proposed.
    """
    lens = camera.intrinsics
    overlays = [Overlay(pose=camera.prior_pose, kind="prior")] if camera.calibrated else []
    if served.status.identifiable or served.proposed is not None:
        overlays.append(Overlay(pose=served.pose, kind="served"))
    # Of the world as it is: the grid lies where the newest pose sees it, and the other one differs.
    ground = ground_of(lens, overlays[-1].pose) if overlays else None
    feet = [_fewer(track.uv) for track in tracks]
    people = _("the feet of {n} people", n=len(feet)) if feet else _("nobody yet")
    if before:
        people += _(" and of {n} before it moved", n=len(before))
    both = _(_OF[tuple(each.kind for each in overlays)])
    snapshot = None
    if still is not None:
        snapshot = f"/cameras/{camera.record.id}/snapshot?v={still.sha256[:12]}"
    return CameraDrawings(
        picture=picture_svg(
            lens,
            overlays,
            feet,
            [_fewer(track.uv) for track in before],
            label=_(
                "The picture with {people}; horizon and ground grid of {poses}.",
                people=people,
                poses=both,
            ),
            ground=ground,
            snapshot_url=snapshot,
            over=_zones(zones),
        ),
        plan=ground_plan_svg(
            lens,
            overlays,
            feet,
            misplaced,
            label=_(
                "The ground from above with {people} and what the camera sees of it by {poses}.",
                people=people,
                poses=both,
            ),
        )
        if overlays
        else Markup(""),
        spacing_m=None if ground is None else ground.spacing_m,
        people=len(feet),
        before=len(before),
        two_poses=len(overlays) > 1,
        horizon=any(horizon_path(lens, each.pose) for each in overlays),
    )


def _zones(view: ZonesView) -> list[str]:
    """Zones where they are, and below them as they were drawn if that is elsewhere."""
    drawn = [(each.zone.id, np.array(each.zone.corners)) for each in view.zones]
    now = [(each.zone.id, each.now.corners) for each in view.zones]
    before = zone_parts(view.intrinsics, drawn, "drawn") if view.moved else []
    return before + zone_parts(view.intrinsics, now, "now")


def _fewer(uv: Array) -> Array:
    """A track with so few points that a hundred of them are drawn in no time."""
    kept = np.unique(np.linspace(0, len(uv) - 1, min(len(uv), _POINTS)).astype(int))
    return np.asarray(uv[kept])
