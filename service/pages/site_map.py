"""`/ui/map`: the cameras of a site on the ground, each with what it sees and how it stands."""

from collections import Counter
from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from models.geometry.pose import CameraPose
from models.monitoring.verdict import pose_after
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.api.schemas import Text
from service.cameras.cameras import CameraView, list_cameras
from service.cameras.status import CameraStatus, camera_statuses
from service.enums import PoseState
from service.pages.drawings.site_map import SiteCamera, site_map_svg
from service.store import cameras, journal
from service.wording.camera import STATES, shown_as

_MOST = 300  # cameras of a map: more hide one another

router = APIRouter(include_in_schema=False)


@router.get("/ui/map")
def show(
    request: Request,
    state: StateDep,
    session: ReadDep,
    site: Annotated[Text, Query(max_length=200)] = "",
) -> HTMLResponse:
    """The map of a site, or of all sites; cameras without a place are listed beside it."""
    newest = journal.newest_event_id(session)
    found = list_cameras(session, state.settings, "", _MOST + 1, site=site)
    shown = found[:_MOST]
    statuses = camera_statuses(session, state.settings, [each.record.id for each in shown])
    placed = [_on_map(each, statuses[each.record.id]) for each in _with_places(shown)]
    on_map = {each.id for each in placed}
    return render(
        request,
        "map.html",
        newest_event=newest,
        site=site,
        sites=cameras.sites(session),
        drawing=site_map_svg(placed),
        placed=placed,
        beside=[each.record for each in shown if each.record.id not in on_map],
        most=_MOST if len(found) > _MOST else None,
    )


def _on_map(view: CameraView, status: CameraStatus) -> SiteCamera:
    shown = shown_as(view.state, status.alerts)
    return SiteCamera(
        id=view.record.id,
        name=view.record.name,
        lens=view.intrinsics,
        prior=view.prior_pose,
        now=_now(status, view.prior_pose),
        shown=shown,
        state=STATES[shown],
    )


def _now(status: CameraStatus, prior: CameraPose) -> CameraPose | None:
    """Where a camera looks that moved; None of one that stands, or where nobody can tell."""
    if status.state != PoseState.DRIFTING or not status.judged or status.drift is None:
        return None
    return pose_after(status.drift, prior)


def _with_places(found: Sequence[CameraView]) -> list[CameraView]:
    """Those that somebody has given a pose and a place: several at one point have nobody's."""
    known = [each for each in found if each.calibrated]
    at = Counter((each.prior_pose.x_m, each.prior_pose.y_m) for each in known)
    alone = len(found) == 1
    return [x for x in known if alone or at[x.prior_pose.x_m, x.prior_pose.y_m] == 1]
