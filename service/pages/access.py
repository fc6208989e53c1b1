"""`/ui/login`, `/ui/logout` and `/ui/tokens`: pages that work without a script.

A token is said once at the login, a cookie stands for it then.
"""

from datetime import UTC, datetime, timedelta
from typing import Annotated
from urllib.parse import parse_qs

from fastapi import APIRouter, Depends, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from sqlalchemy.orm import Session

from models.durations import HOUR_S
from service.access import sessions, tokens
from service.access.tokens import MadeToken, TokenSpec
from service.api.middleware.authentication import COOKIE, is_proxy, refuse
from service.api.middleware.dependencies import (
    AddressDep,
    AppState,
    CallerDep,
    ReadDep,
    StateDep,
    WriteDep,
    media_type_of,
)
from service.api.middleware.hosts import auth_on
from service.api.middleware.pages import render
from service.api.tokens import list_tokens
from service.errors import (
    FieldError,
    ForbiddenError,
    MalformedError,
    ServiceError,
    TooLargeError,
    TooManyRequestsError,
    UnauthorizedError,
    UnsupportedMediaTypeError,
)
from service.settings import Settings
from service.store.access import name_in, set_actor
from service.wording.language import _

_MOST_BYTES = 16 * 1024
_MOST_FIELDS = 100
_MOST_DAYS = 36_500
_TYPE = "application/x-www-form-urlencoded"


class Form(dict[str, list[str]]):
    """The fields of a form; one that was left empty is missing."""

    def one(self, name: str) -> str:
        """The text of a field; empty where nothing was typed."""
        return self.get(name, [""])[0].strip()


async def read_form(request: Request) -> Form:
    """The fields of a request's form.

    Raises:
        UnsupportedMediaTypeError: it is no form.
        TooLargeError: more than a form of ours has.
        MalformedError: it cannot be read, or has NUL characters in it.
    """
    media_type = media_type_of(request)
    if media_type != _TYPE:
        raise UnsupportedMediaTypeError(f"Content-Type: {_TYPE} is needed, got {media_type!r:.80}")
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _MOST_BYTES:
            raise TooLargeError(f"body: at most {_MOST_BYTES} bytes of a form are taken")
    try:
        form = Form(parse_qs(body.decode("utf-8"), max_num_fields=_MOST_FIELDS))
    except ValueError as error:  # UnicodeDecodeError is one
        raise MalformedError(f"body: this is no form: {error}") from error
    for name, values in form.items():
        if any("\0" in value for value in values):
            raise MalformedError(f"{name[:80]!r}: text without NUL characters is needed")
    return form


FormDep = Annotated[Form, Depends(read_form)]


router = APIRouter(include_in_schema=False)


@router.get("/ui/login")
def show_login(request: Request, state: StateDep, next: str = "") -> Response:
    """The form that a token is pasted into."""
    if not auth_on(state.settings):
        return RedirectResponse("/", status_code=303)
    return render(request, "login.html", next=ours(next))


@router.post("/ui/login")
def log_in(request: Request, form: FormDep, state: StateDep, address: AddressDep) -> Response:
    """Begin a session, and go on to where the person wanted to."""
    wanted = ours(form.one("next"))
    if not auth_on(state.settings):
        return RedirectResponse("/", status_code=303)
    try:
        with state.store.read() as reading:  # strangers get no write lock
            caller = sessions.check_login(reading, form.one("token"))
    except (UnauthorizedError, ForbiddenError) as error:
        return _refused(request, wanted, error)
    with state.store.write() as session:
        set_actor(session, caller, address)
        cookie = sessions.log_in(session, state.settings, caller)
    answer = RedirectResponse(wanted or "/", status_code=303)
    answer.set_cookie(
        COOKIE,
        cookie,
        max_age=int(state.settings.session_hours * HOUR_S),
        httponly=True,
        samesite="lax",
        secure=over_https(request, state.settings),
    )
    return answer


@router.post("/ui/logout")
def log_out(caller: CallerDep, session: WriteDep) -> Response:
    """End the session."""
    if caller is not None:
        sessions.log_out(session, caller)
    answer = RedirectResponse("/ui/login", status_code=303)
    answer.delete_cookie(COOKIE, httponly=True, samesite="lax")
    return answer


def _refused(request: Request, wanted: str, error: UnauthorizedError | ForbiddenError) -> Response:
    """The form again, with the reason."""
    said: ServiceError = error
    try:
        refuse(request)
    except TooManyRequestsError as waiting:
        said = waiting
    reason = said.detail.partition(": ")[2]
    page = render(request, "login.html", said.status, next=wanted, reason=reason)
    if said.retry_after_s is not None:
        page.headers["Retry-After"] = str(round(said.retry_after_s))
    return page


def over_https(request: Request, settings: Settings) -> bool:
    """True if the person's browser speaks https, whatever is between."""
    if request.headers.get("origin", "").startswith("https://") or request.url.scheme == "https":
        return True
    forwarded = request.headers.get("x-forwarded-proto", "").lower()
    return forwarded == "https" and is_proxy(request, settings)


def ours(wanted: str) -> str:
    """A path of this service; empty where somebody made up a link to elsewhere."""
    plain = wanted.isascii() and wanted.isprintable() and "\\" not in wanted
    return wanted if plain and wanted.startswith("/") and not wanted.startswith("//") else ""


@router.get("/ui/tokens")
def show_tokens(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Tokens, and a form for another one."""
    return _tokens_page(request, state, session)


@router.post("/ui/tokens")
def create(request: Request, form: FormDep, state: StateDep, session: WriteDep) -> HTMLResponse:
    """Make a token by the form, and show it this once."""
    try:
        made = tokens.make_token(session, _spec(form), name_in(session, None))
    except MalformedError as error:
        session.rollback()
        return _tokens_page(request, state, session, typed=form, wrong=error.errors)
    return _tokens_page(request, state, session, made=made)


@router.post("/ui/tokens/{token_id}/revoke")
def revoke(token_id: str, session: WriteDep) -> RedirectResponse:
    """Revoke a token by its button."""
    tokens.revoke_token(session, token_id, name_in(session, None))
    return RedirectResponse("/ui/tokens", status_code=303)


def _tokens_page(
    request: Request,
    state: AppState,
    session: Session,
    *,
    made: MadeToken | None = None,
    typed: Form | None = None,
    wrong: tuple[FieldError, ...] = (),
) -> HTMLResponse:
    return render(
        request,
        "tokens.html",
        422 if wrong else 200,
        tokens=list_tokens(session).items,
        made=made,
        typed=typed or Form(),
        wrong={error.pointer[1:]: error.reason for error in wrong},
        access_on=auth_on(state.settings),
    )


def _spec(form: Form) -> TokenSpec:
    """The token that was typed, as the use case takes it.

    Raises:
        MalformedError: the days are no number.
    """
    cameras = tuple(form.one("cameras").replace(",", " ").split())
    sources = tuple(name.strip() for name in form.one("sources").split(",") if name.strip())
    days = form.one("days")
    expires_at = None
    if days:
        if not days.isascii() or not days.isdigit() or not 0 < int(days) <= _MOST_DAYS:
            got = f"{days!r:.20}"
            reason = _("a number of days from 1 to {n} is needed, got {got}", n=_MOST_DAYS, got=got)
            raise MalformedError.of_field("expires_at", reason)
        expires_at = datetime.now(UTC) + timedelta(days=int(days))
    return TokenSpec(
        name=form.one("name"),
        scopes=tuple(form.get("scopes", [])),
        cameras=cameras or None,
        sources=sources or None,
        expires_at=expires_at,
    )
