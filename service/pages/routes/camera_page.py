"""`/ui/cameras/{id}`: the page of a camera."""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import CHARTS_URL, render
from service.enums import AlertState
from service.pages.camera_drawings import draw_camera
from service.pages.camera_page import CameraPage, view_camera_page
from service.wording import alerts, camera, moves
from service.wording.reasons import in_words
from service.wording.times import Clock, next_morning

router = APIRouter(include_in_schema=False)
# The one style that plotly 7.1.0 writes into a page by itself, of maps, which are not used here.
# The hash lets in that and no other; a browser test tells when another version needs another one.
_CHARTS_STYLE = "'sha256-ji27qzEtxXZW+7dun6UwjHXJ18e6WAin1VvNtkzIE/o='"


@router.get("/ui/cameras/{camera_id}")
def show(camera_id: str, request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Has the camera moved, how far, since when, how sure, and what to do now."""
    page = view_camera_page(session, state.settings, camera_id)
    state.watched.note(camera_id)
    zone = state.settings.zone
    clock = Clock(now=page.now, zone=zone)
    answer = render(
        request,
        "camera/page.html",
        page=page,
        clock=clock,
        zone_name=state.settings.timezone,
        headline=camera.headline(page.facts, clock),
        drawings=draw_camera(page),
        parameters=moves.parameter_rows(
            page.camera.prior_pose, page.pose.pose, page.pose.status.estimate
        ),
        misplaced=moves.misplaced_words(page.misplaced),
        flags=_flags(page, clock),
        activity=[(entry, alerts.entry_words(entry, clock)) for entry in page.activity],
        words=alerts,
        in_words=in_words,
        states=camera.STATES,
        chart_facts=_chart_facts(page),
        tomorrow=next_morning(page.now, zone).isoformat(),
        charts_url=CHARTS_URL,
        newest_event=page.newest_event_id,
    )
    answer.headers["Content-Security-Policy"] += f"; style-src 'self' {_CHARTS_STYLE}"
    return answer


def _flags(page: CameraPage, clock: Clock) -> list[str]:
    """Flags of open alerts and maintenance, each once."""
    until = None if page.attended is None else page.attended.to_at
    flags = [*camera.page_flags(page.camera.record.lacks, until, clock)]
    for story in page.firing:
        flags += camera.page_alert_flags(story.record, story.group, clock)
    return list(dict.fromkeys(flags))


def _chart_facts(page: CameraPage) -> dict[str, Any]:
    """Marks of the charts beside the history: prior poses, oldest first, and alerts."""
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
                "words": alerts.KINDS[story.record.kind],
                "firing": story.record.state == AlertState.FIRING,
            }
            for story in page.alerts
        ],
    }
