"""The HTTP application. This process never imports torch."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version
from typing import TypedDict

from fastapi import FastAPI

from service.api import (
    actions,
    activity,
    aim,
    alerts,
    bridges,
    calibrations,
    cameras,
    client,
    documented,
    events,
    ground,
    handovers,
    hints,
    maintenance,
    operation,
    plans,
    poses,
    reports,
    snapshots,
    sources,
    tokens,
    tracks,
    trainings,
    webhooks,
    zones,
)
from service.api.middleware import pages
from service.api.middleware.admission import (
    AdmissionMiddleware,
    sessions_at_once,
    start_threads,
)
from service.api.middleware.authentication import GuardMiddleware
from service.api.middleware.dependencies import AppState
from service.api.middleware.event_feed import Feed
from service.api.middleware.hosts import OriginMiddleware
from service.api.middleware.instruments import InstrumentMiddleware, Instruments
from service.api.middleware.language import LanguageMiddleware
from service.api.middleware.problems import FORESEEN, ProblemMiddleware, answer_of
from service.api.middleware.rate_limits import RateMiddleware
from service.cameras.tracks import Quota
from service.job_queue import JobQueue
from service.pages import (
    access,
    aim_page,
    alerts_page,
    camera_page,
    connecting,
    fleet,
    handover,
    health,
    language,
    reference,
    registration,
    report,
    site_map,
    wall,
)
from service.pages import webhooks as webhooks_page
from service.settings import Settings
from service.store.engines.store import Store

_SPARE_THREADS = 8


class LifespanState(TypedDict):
    """What the lifespan hands to every request."""

    app: AppState


def create_app(settings: Settings) -> FastAPI:
    """The application over a migrated data directory; nothing connects before it starts."""
    instruments = Instruments()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[LifespanState]:
        at_once = sessions_at_once(settings)
        # A request is in one thread at a time; some are left for what needs no turn.
        await start_threads(at_once + _SPARE_THREADS)
        store = Store(settings, settings.http_wait_s, at_once)
        state = AppState(
            settings=settings,
            store=store,
            queue=JobQueue(store.engine),
            instruments=instruments,
            quota=Quota(settings),
            feed=Feed(store),
        )
        yield {"app": state}
        state.stopping.set()
        state.queue.close()
        store.close()

    app = FastAPI(
        title="surefoot",
        version=version("surefoot"),
        summary="Detects from pedestrian tracks that a fixed camera has moved.",
        lifespan=lifespan,
        docs_url=None,  # FastAPI's own fetch their viewers from a public host
        redoc_url=None,
        exception_handlers=dict.fromkeys(FORESEEN, answer_of),
    )
    # A path is looked for in one after another: what is asked for most comes first. As they are:
    # `include_router` takes each of them apart again, at every start.
    for module in (
        tracks,
        poses,
        calibrations,
        cameras,
        sources,
        snapshots,
        plans,
        aim,
        ground,
        hints,
        zones,
        trainings,
        alerts,
        actions,
        maintenance,
        webhooks,
        events,
        activity,
        reports,
        handovers,
        operation,
        bridges,
        client,
        fleet,
        alerts_page,
        site_map,
        camera_page,
        aim_page,
        connecting,
        registration,
        health,
        reference,
        report,
        handover,
        wall,
        webhooks_page,
        tokens,
        access,
        language,
    ):
        app.router.routes.extend(module.router.routes)
    documented.document_routes(app)
    pages.mount_static(app)
    # The last one is outermost.
    app.add_middleware(AdmissionMiddleware, settings=settings)
    app.add_middleware(RateMiddleware, settings=settings)
    app.add_middleware(GuardMiddleware, settings=settings)
    app.add_middleware(OriginMiddleware, settings=settings)
    app.add_middleware(ProblemMiddleware)
    app.add_middleware(LanguageMiddleware)
    app.add_middleware(InstrumentMiddleware, instruments=instruments)
    app.state.instruments = instruments
    return app
