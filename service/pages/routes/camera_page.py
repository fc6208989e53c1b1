"""`/ui/cameras/{id}`: the page of a camera, and the script that draws its charts."""

from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from fastapi.responses import HTMLResponse, Response

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.packaged import CHARTS, CHARTS_URL, packaged_file
from service.api.middleware.pages import render
from service.enums import AlertState
from service.pages.drawings.camera import draw_camera
from service.pages.views import camera_page
from service.pages.views.camera_page import CameraPage
from service.pages.wording import camera_words
from service.pages.wording.activity_words import entry_words
from service.pages.wording.camera_words import Clock
from service.pages.wording.moments import next_morning
from service.pages.wording.sentences import headline
from service.pages.wording.words import STATES

router = APIRouter(include_in_schema=False)
# The one style that plotly 7.1.0 writes into a page by itself, of maps, which are not used here.
# The hash lets in that and no other; a browser test tells when another version needs another one.
_CHARTS_STYLE = "'sha256-ji27qzEtxXZW+7dun6UwjHXJ18e6WAin1VvNtkzIE/o='"


@router.get("/ui/cameras/{camera_id}")
def show(camera_id: str, request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Has the camera moved, how far, since when, how sure, and what to do now."""
    page = camera_page.view_camera_page(session, state.settings, camera_id)
    state.watched.note(camera_id)
    zone = state.settings.zone
    clock = Clock(now=page.now, zone=zone)
    estimate = page.pose.estimate
    answer = render(
        request,
        "camera/page.html",
        page=page,
        clock=clock,
        zone_name=state.settings.timezone,
        headline=headline(page, zone),
        drawings=draw_camera(page),
        parameters=camera_words.parameter_rows(page.camera.prior_pose, page.pose.pose, estimate),
        misplaced=camera_words.misplaced_words(page.misplaced),
        flags=camera_words.flags(page, clock),
        activity=[(entry, entry_words(entry, clock)) for entry in page.activity],
        words=camera_words,
        states=STATES,
        chart_facts=_chart_facts(page),
        tomorrow=next_morning(page.now, zone).isoformat(),
        charts_url=CHARTS_URL,
        newest_event=page.newest_event_id,
    )
    answer.headers["Content-Security-Policy"] += f"; style-src 'self' {_CHARTS_STYLE}"
    return answer


@router.get(CHARTS_URL)
def charts(accept_encoding: Annotated[str, Header()] = "") -> Response:
    """The chart library's script, out of its installed package."""
    return packaged_file("plotly", CHARTS, accept_encoding)


def _chart_facts(page: CameraPage) -> dict[str, Any]:
    """What charts show beside the history: prior poses, oldest first, and alerts."""
    return {
        "camera_id": page.camera.record.id,
        "priors": [
            {
                "at": prior.created_at.isoformat(),
                "height_m": prior.height_m,
                "tilt_rad": prior.tilt_rad,
                "roll_rad": prior.roll_rad,
                "heading_rad": prior.heading_rad,
            }
            for prior in reversed(page.priors)
        ],
        "alerts": [
            {
                "at": (story.record.changed_at or story.record.opened_at).isoformat(),
                "words": camera_words.KINDS[story.record.kind],
                "firing": story.record.state == AlertState.FIRING,
            }
            for story in page.alerts
        ],
    }
