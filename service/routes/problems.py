"""Problem documents (RFC 9457); for who looks for a page, a page."""

from collections.abc import Mapping
from http import HTTPStatus

from fastapi import Request
from fastapi.encoders import jsonable_encoder
from fastapi.responses import JSONResponse, Response

from service.errors import FieldError, ServiceError
from service.routes import pages


def problem(
    request: Request,
    status: int,
    code: str,
    detail: str,
    errors: tuple[FieldError, ...] = (),
    headers: Mapping[str, str] | None = None,
) -> Response:
    """The answer that says what is wrong."""
    answer: Response
    if pages.wants_page(request):
        answer = pages.render(
            request, "problem.html", status, title=HTTPStatus(status).phrase, detail=detail
        )
    else:
        content = {
            "type": "about:blank",
            "title": HTTPStatus(status).phrase,
            "status": status,
            "code": code,
            "detail": detail,
        }
        if errors:
            content["errors"] = [
                {"pointer": error.pointer, "reason": error.reason} for error in errors
            ]
        answer = JSONResponse(
            jsonable_encoder(content), status_code=status, media_type="application/problem+json"
        )
    answer.headers.update(headers or {})
    return answer


def problem_of(request: Request, error: ServiceError) -> Response:
    """The answer of an error of ours."""
    return problem(request, error.status, error.code, error.detail, error.errors, error.headers)
