"""`/ui/map`: the cameras of a site on the ground, each with what it sees and how it stands."""

from collections import Counter
from collections.abc import Sequence
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from models.geometry.pose import CameraPose
from models.monitoring.drift import pose_after
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.api.schemas import Text
from service.cameras.status import CameraStatus, camera_statuses
from service.enums import PoseState
from service.pages.drawings.site_map import SiteCamera, site_map_svg
from service.store import cameras, journal
from service.store.cameras import CameraRecord, PriorPoseRecord
from service.wording.camera import STATES, shown_as
from service.wording.language import _

_MOST = 300  # cameras of a map: more hide one another
_SetUp = tuple[CameraRecord, PriorPoseRecord]

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
    ids = cameras.ids_labelled(session, "", site, ())
    statuses = camera_statuses(session, state.settings, ids[:_MOST])
    found = [(record, prior) for record, prior, _ in cameras.all_as_set_up(session, statuses)]
    placed = [_on_map(*each, statuses[each[0].id]) for each in _with_places(found)]
    on_map = {each.id for each in placed}
    return render(
        request,
        "map.html",
        newest_event=newest,
        site=site,
        sites=cameras.sites(session),
        drawing=site_map_svg(placed),
        placed=placed,
        beside=[record for record, _ in found if record.id not in on_map],
        most=_MOST if len(ids) > _MOST else None,
    )


def _on_map(record: CameraRecord, prior: PriorPoseRecord, status: CameraStatus) -> SiteCamera:
    shown = shown_as(status.state, status.alerts)
    return SiteCamera(
        id=record.id,
        name=record.name,
        lens=record.intrinsics,
        prior=prior.pose,
        now=_now(status, prior.pose),
        shown=shown,
        state=_(STATES[shown]),
    )


def _now(status: CameraStatus, prior: CameraPose) -> CameraPose | None:
    """Where a camera looks that moved; None of one that stands, or where nobody can tell."""
    if status.state != PoseState.DRIFTING or not status.judged or status.drift is None:
        return None
    return pose_after(status.drift, prior)


def _with_places(found: Sequence[_SetUp]) -> list[_SetUp]:
    """Those that somebody has given a pose and a place: several at one point have nobody's."""
    known = [each for each in found if not each[1].assumed]
    at = Counter((prior.x_m, prior.y_m) for _, prior in known)
    alone = len(found) == 1
    return [each for each in known if alone or at[each[1].x_m, each[1].y_m] == 1]
