"""`/ui/login` and `/ui/logout`: a token is said once, a cookie stands for it then."""

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from models.durations import HOUR_S
from service.access import sessions
from service.api.middleware.authentication import COOKIE, is_proxy, refuse
from service.api.middleware.dependencies import CallerDep, StateDep, WriteDep
from service.api.middleware.hosts import auth_on
from service.api.middleware.pages import render
from service.errors import ForbiddenError, ServiceError, TooManyRequestsError, UnauthorizedError
from service.pages.routes.forms import FormDep
from service.settings import Settings

router = APIRouter(include_in_schema=False)


@router.get("/ui/login")
def show(request: Request, state: StateDep, next: str = "") -> Response:
    """The form that a token is pasted into."""
    if not auth_on(state.settings):
        return RedirectResponse("/", status_code=303)
    return render(request, "login.html", next=_ours(next))


@router.post("/ui/login")
def log_in(request: Request, form: FormDep, state: StateDep) -> Response:
    """Begin a session, and go on to where the person wanted to."""
    wanted = _ours(form.one("next"))
    if not auth_on(state.settings):
        return RedirectResponse("/", status_code=303)
    try:
        with state.store.read() as reading:  # strangers get no write lock
            caller = sessions.check_login(reading, form.one("token"))
    except (UnauthorizedError, ForbiddenError) as error:
        return _refused(request, wanted, error)
    with state.store.write() as session:
        cookie = sessions.log_in(session, state.settings, caller)
    answer = RedirectResponse(wanted or "/", status_code=303)
    answer.set_cookie(
        COOKIE,
        cookie,
        max_age=int(state.settings.session_hours * HOUR_S),
        httponly=True,
        samesite="lax",
        secure=_over_https(request, state.settings),
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


def _over_https(request: Request, settings: Settings) -> bool:
    """True if the person's browser speaks https, whatever is between."""
    if request.headers.get("origin", "").startswith("https://") or request.url.scheme == "https":
        return True
    forwarded = request.headers.get("x-forwarded-proto", "").lower()
    return forwarded == "https" and is_proxy(request, settings)


def _ours(wanted: str) -> str:
    """A path of this service; empty where somebody made up a link to elsewhere."""
    plain = wanted.isascii() and wanted.isprintable() and "\\" not in wanted
    return wanted if plain and wanted.startswith("/") and not wanted.startswith("//") else ""
