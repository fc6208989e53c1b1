"""`/ui/health`: workers, queue, bridges and webhooks; and the banner on every page of troubles."""

from dataclasses import dataclass
from datetime import UTC, datetime

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from markupsafe import Markup
from sqlalchemy.orm import Session

from service.access.tokens import Caller
from service.api.middleware.dependencies import ReadDep, StateDep
from service.api.middleware.pages import render
from service.enums import RunKind, TokenScope
from service.notifications.webhooks import list_webhooks
from service.operations.result_ages import ResultAges, Waiting, result_ages
from service.operations.troubles import find_troubles
from service.pages.drawings.sparkline import trend
from service.store import bridges, cameras, pictures, runs, tracks, workers
from service.wording.language import N_, _
from service.wording.times import Clock, duration

router = APIRouter(include_in_schema=False)

_HOURS = 24
_KINDS = {RunKind.MONITOR: N_("Monitoring"), RunKind.FULL: N_("Full estimate")}


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow:
    """The estimation runs of a kind in the last hours, and the age of their results.

    `ages` are median, 95th percentile and maximum in words; empty without results.
    """

    name: str
    ages: tuple[str, ...]
    runs: int
    cpu_s: float
    drawing: Markup

    @property
    def cpu_ms(self) -> float | None:
        """CPU time of one run; None if there was none."""
        return 1000 * self.cpu_s / self.runs if self.runs else None


def _run_rows(session: Session, waiting: Waiting, now: datetime) -> list[RunRow]:
    ages, hours = result_ages(session, waiting, now), runs.by_hour(session, _HOURS, now)
    rows = []
    for kind, name in _KINDS.items():
        total = sum(hours[kind], start=runs.RunTotal())
        drawing = trend([hour.cpu_s for hour in hours[kind]])
        row = RunRow(
            name=_(name),
            ages=_in_words(ages.get(kind)),
            runs=total.runs,
            cpu_s=total.cpu_s,
            drawing=drawing,
        )
        rows.append(row)
    return rows


def _in_words(ages: ResultAges | None) -> tuple[str, ...]:
    if ages is None:
        return ()
    return tuple(duration(age_s) for age_s in (ages.median_s, ages.p95_s, ages.worst_s))


@router.get("/ui/health")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Workers, queue, results, bridges and webhooks, with their failures."""
    caller: Caller | None = request.state.caller
    now = datetime.now(UTC)
    waiting = tracks.unseen_since(session)
    came = [at for _id, at in waiting.values()]
    return render(
        request,
        "health.html",
        clock=Clock(now=now, zone=state.settings.zone),
        troubles=find_troubles(session, state.settings),
        run_rows=_run_rows(session, waiting, now),
        workers=workers.every(session),
        bridges=bridges.every(session),
        waiting=len(came),
        oldest=min(came, default=None),
        failing=cameras.failing(session),
        webhooks=list_webhooks(session),
        agreement=pictures.agreement(session),
        administers=caller is None or caller.may(TokenScope.ADMIN),
    )


@router.get("/ui/health/banner")
def banner(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """What is wrong, for the head of every page; empty where nothing is."""
    return render(
        request,
        "_health_banner.html",
        clock=Clock(now=datetime.now(UTC), zone=state.settings.zone),
        troubles=find_troubles(session, state.settings),
    )
