"""Names, errors and examples of all routes in `/openapi.json`.

A route's operation id is the name of its function. Its summary is the first line of the docstring,
and its description the rest.

FastAPI describes its own 422, which this service does not return, and no other error. The possible
errors of a route follow from its inputs: a name in the path, a body, a header, a change.

`examples.json` has a real example of each schema. `python -m tests.reference --write` writes it,
and a test compares it with new ones.
"""

import json
from collections.abc import Iterator
from inspect import getdoc
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field
from pydantic.json_schema import models_json_schema

from service.api.middleware.scopes import need_of

_SCHEME = "token"
_REF = "#/components/schemas/{model}"
_MEDIA_TYPE = "application/problem+json"
_SAFE = frozenset(("get", "head", "options"))
_OURS_NOT = ("HTTPValidationError", "ValidationError")  # FastAPI's 422
_WORDS = {
    304: "What was read before is still so",
    400: "The body is no text in UTF-8",
    401: "A token is needed",
    403: "The token does not allow this, or it is switched off",
    404: "There is no such thing",
    409: "It does not fit the state that things are in",
    412: "If-Match names another version than the stored one, which is `etag`",
    413: "Larger than a stated limit",
    415: "A content type that is not taken",
    421: "This service does not go by the name in Host",
    422: "Malformed; `errors` names each field",
    428: "If-Match is needed; `etag` is what it has to be now",
    429: "Too much at once; Retry-After says when to come back",
    503: "Not now; Retry-After says when to come back",
    507: "No room left to store it",
}
_RETRY_AFTER = {"Retry-After": {"schema": {"type": "string"}, "description": "Seconds, or a date"}}
ETAG = {"ETag": {"schema": {"type": "string"}, "description": "The version, for If-Match"}}
_HEADERS = {412: ETAG, 428: ETAG, 429: _RETRY_AFTER, 503: _RETRY_AFTER}


class ProblemField(BaseModel):
    """One thing wrong in a request."""

    pointer: str = Field(description="JSON Pointer into the body, or the name of a parameter")
    reason: str = Field(description="what is needed, and what came")


class Problem(BaseModel):
    """What went wrong; programs go by `code`, which stays, people by `detail`."""

    type: str = "about:blank"
    title: str
    status: int
    code: str
    detail: str
    errors: list[ProblemField] | None = None
    etag: str | None = Field(None, description="with 412 and 428: what If-Match has to be now")


def document_routes(app: FastAPI) -> None:
    """Complete the OpenAPI document of an application that has all its routes."""
    described = app.openapi
    for route in app.routes:
        if isinstance(route, APIRoute) and route.include_in_schema:
            summary, _, rest = (getdoc(route.endpoint) or "").partition("\n")
            route.operation_id = route.name
            route.summary, route.description = summary.strip().removesuffix("."), rest.strip()

    def openapi() -> dict[str, Any]:
        if app.openapi_schema is None:
            _correct(described())
        assert app.openapi_schema is not None
        return app.openapi_schema

    app.openapi = openapi  # type: ignore[method-assign]


def schema_name(schema: dict[str, Any]) -> str | None:
    """The name of the schema that a body is of, or may be of instead of null; else None."""
    (of, *_) = schema.get("anyOf", [schema])
    name: str = of.get("$ref", "").rpartition("/")[2]
    return name or None


def _correct(document: dict[str, Any]) -> None:
    told = json.loads(Path(__file__).with_name("examples.json").read_text())
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    for name in _OURS_NOT:
        schemas.pop(name, None)
    _, made = models_json_schema([(Problem, "serialization")], ref_template=_REF)
    schemas |= made["$defs"]
    problems = {f"Problem{status}": value for status, value in told["problems"].items()}
    document["components"]["examples"] = {
        name: {"value": value}
        for name, value in (told["schemas"] | problems).items()
        if name in schemas or name in problems
    }
    document["components"]["securitySchemes"] = {
        _SCHEME: {
            "type": "http",
            "scheme": "bearer",
            "description": "A token of `surefoot token add`; none is asked for where access is off",
        }
    }
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            answers = operation["responses"]
            answers.pop("422", None)
            for status in _statuses(path, method, operation):
                answers.setdefault(str(status), _answer(status))
            own = told["others"].get(f"{method.upper()} {path}", {})
            for part in (operation.get("requestBody", {}), *answers.values()):
                _show(part.get("content", {}), told["schemas"], own)
            need = need_of(method.upper(), path)[0]
            operation["security"] = [] if need is None else [{_SCHEME: [need]}]


def _statuses(path: str, method: str, operation: dict[str, Any]) -> Iterator[int]:
    """The errors that an operation may answer."""
    if path == "/healthz":  # asks for nothing and needs nothing
        return
    taken = {(parameter["in"], parameter["name"]) for parameter in operation.get("parameters", ())}
    places = {place for place, _ in taken}
    yield from (401, 403, 421, 429, 503)
    if "path" in places:
        yield 404
    if places or "requestBody" in operation:
        yield 422
    if ("header", "if-none-match") in taken:
        yield 304
    if ("header", "if-match") in taken:
        yield from (412, 428)
    if method not in _SAFE:
        yield from (409, 507)
    if "requestBody" in operation:
        yield from (400, 413)
        if set(operation["requestBody"]["content"]) != {"application/json"}:
            yield 415


def _show(contents: dict[str, Any], by_schema: dict[str, Any], own: dict[str, Any]) -> None:
    """Show the example of each content that has one: the one of its schema, or its own."""
    for kind, content in contents.items():
        if (name := schema_name(content.get("schema", {}))) in by_schema:
            content["examples"] = _example_named(name)
        elif kind in own:
            content["example"] = own[kind]


def _example_named(name: str | None) -> dict[str, Any]:
    return {"example": {"$ref": f"#/components/examples/{name}"}}


def _answer(status: int) -> dict[str, Any]:
    answer: dict[str, Any] = {"description": _WORDS[status]}
    if status >= 400:
        schema = {"$ref": _REF.format(model="Problem")}
        examples = _example_named(f"Problem{status}")
        answer["content"] = {_MEDIA_TYPE: {"schema": schema, "examples": examples}}
    if status in _HEADERS:
        answer["headers"] = _HEADERS[status]
    return answer
