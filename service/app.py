"""The HTTP application. This process never imports torch."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from http import HTTPStatus
from typing import TypedDict

from fastapi import FastAPI, Request
from fastapi.encoders import jsonable_encoder
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.exceptions import HTTPException

from models.errors import CalibrationError
from service.errors import FieldError, ServiceError
from service.job_queue import JobQueue
from service.routes import (
    activity,
    alerts,
    camera_page,
    cameras,
    events,
    fleet,
    maintenance,
    metrics,
    operation,
    pages,
    poses,
    registration,
    snapshots,
    sources,
    tracks,
    trainings,
    webhooks,
)
from service.routes.instruments import InstrumentMiddleware, Instruments
from service.routes.state import AppState
from service.settings import Settings
from service.store.database import Store


class LifespanState(TypedDict):
    """What the lifespan hands to every request."""

    app: AppState


def create_app(settings: Settings) -> FastAPI:
    """The application over a migrated data directory; nothing connects before it starts."""
    instruments = Instruments()

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[LifespanState]:
        store = Store(settings)
        state = AppState(
            settings=settings,
            store=store,
            queue=JobQueue(store.engine),
            instruments=instruments,
        )
        yield {"app": state}
        state.stopping.set()
        state.queue.close()
        store.close()

    app = FastAPI(
        title="surefoot",
        version="0.1.0",
        summary="Tells when a fixed camera has moved, from the paths of people walking.",
        lifespan=lifespan,
    )
    for module in (
        cameras,
        tracks,
        sources,
        poses,
        snapshots,
        trainings,
        alerts,
        maintenance,
        webhooks,
        events,
        activity,
        operation,
        metrics,
        fleet,
        camera_page,
        registration,
    ):
        app.include_router(module.router)
    pages.mount_static(app)
    app.add_middleware(InstrumentMiddleware, instruments=instruments)
    app.add_exception_handler(ServiceError, _service_error)
    app.add_exception_handler(CalibrationError, _calibration_error)
    app.add_exception_handler(RequestValidationError, _validation_error)
    app.add_exception_handler(HTTPException, _http_error)
    return app


def _service_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, ServiceError)
    return _problem(request, error.status, error.code, error.detail, error.errors)


def _calibration_error(request: Request, error: Exception) -> Response:
    return _problem(request, 409, "calibration", str(error))


def _validation_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    errors = tuple(
        FieldError(
            pointer="".join(f"/{part}" for part in item["loc"] if part != "body"),
            reason=f"{item['msg']}, got {item.get('input')!r:.80}",
        )
        for item in error.errors()
    )
    detail = "; ".join(f"{item.pointer[1:] or 'body'}: {item.reason}" for item in errors)
    return _problem(request, 422, "malformed", detail, errors)


def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    code = HTTPStatus(error.status_code).phrase.lower().replace(" ", "_")
    return _problem(request, error.status_code, code, str(error.detail))


def _problem(
    request: Request, status: int, code: str, detail: str, errors: tuple[FieldError, ...] = ()
) -> Response:
    """A problem document (RFC 9457); for who looks for a page, a page."""
    if pages.wants_page(request):
        return pages.render(
            request, "problem.html", status, title=HTTPStatus(status).phrase, detail=detail
        )
    content = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "code": code,
        "detail": detail,
    }
    if errors:
        content["errors"] = [{"pointer": error.pointer, "reason": error.reason} for error in errors]
    return JSONResponse(
        jsonable_encoder(content), status_code=status, media_type="application/problem+json"
    )
