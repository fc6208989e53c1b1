"""Authentication by a token, a page's session, or a proxy that logs people in."""

import hmac
import logging
import time
from collections.abc import Callable
from datetime import UTC, datetime
from ipaddress import ip_address
from urllib.parse import quote

import anyio
from anyio.to_thread import run_sync
from fastapi import Request
from sqlalchemy.exc import SQLAlchemyError
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from service.access import sessions, tokens
from service.access.activity import note
from service.access.attempts import Attempts
from service.access.tokens import Caller
from service.api.middleware.admission import LOOKUPS
from service.api.middleware.hosts import auth_on
from service.api.middleware.pages import STATIC_URL
from service.api.middleware.scopes import need_of
from service.enums import Activity, TokenScope
from service.errors import (
    ForbiddenError,
    NotFoundError,
    ServiceError,
    TooManyRequestsError,
    UnauthorizedError,
)
from service.settings import Settings
from service.store import access
from service.store.access import set_actor
from service.store.engines.store import Store
from service.wording.language import _

log = logging.getLogger("surefoot.access")

COOKIE = "surefoot_session"
PROXY_HEADER = "X-Surefoot-Proxy"
_USE_IS_KEPT_EVERY_S = 60.0
_TOLD_MORE = "/readyz"  # open, but what is wrong is not for strangers
_PARTS = (
    "/ui/fleet/",
    "/ui/health/",
)  # of a page: scripts fetch them, and nobody looks at them alone


class GuardMiddleware:
    """Answers 401 or 403, or leads to the login, before anything reads a request.

    What a request may do is `request.state.caller`, None where access is off, and the id of its
    token `request.state.token_id`.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._settings = settings
        self._on = auth_on(settings)
        self._attempts = Attempts()
        self._used_s: dict[str, float] = {}
        self._looking = anyio.CapacityLimiter(LOOKUPS - 1)
        self._keeping = anyio.CapacityLimiter(1)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or lead to the login.

        Raises:
            UnauthorizedError: nobody is known to ask.
            NotFoundError: the path has a name in it that nothing can have.
            ForbiddenError: who asks may not do this.
            TooManyRequestsError: too many tokens from there were none.
        """
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        request.state.caller = request.state.token_id = None
        request.state.address = address_of(request, self._settings)
        request.state.attempts = self._attempts
        need, parameters = need_of(scope["method"], scope["path"]) if self._on else (None, {})
        if need is not None and not _is_static(request):
            try:
                await self._let_in(request, need, parameters)
            except UnauthorizedError:
                if not _looks_for_page(request):
                    raise
                await _to_login(request)(scope, receive, send)
                return
        elif scope["path"] == _TOLD_MORE and "authorization" in request.headers:
            await self._recognise(request)
        if "\0" in scope["path"]:  # to ask PostgreSQL for one is an error
            raise NotFoundError("path: nothing has a name with a NUL character in it")
        await self._app(scope, receive, send)

    async def _recognise(self, request: Request) -> None:
        """Note who asks where everybody may; with a store that fails, nobody is known."""
        find = _finder(request, self._settings)
        try:
            caller = await run_sync(find, request.state.app.store, limiter=self._looking)
        except (SQLAlchemyError, ServiceError) as error:
            log.warning("caller_unknown", extra={"error": str(error)})
            return
        if caller is not None and caller.may(TokenScope.READ):
            request.state.caller, request.state.token_id = caller, caller.token_id

    async def _let_in(self, request: Request, need: TokenScope, parameters: dict[str, str]) -> None:
        store: Store = request.state.app.store
        find = _finder(request, self._settings)
        caller = await run_sync(find, store, limiter=self._looking)
        if caller is None:
            if "authorization" in request.headers:
                await run_sync(refuse, request, limiter=self._keeping)
                raise UnauthorizedError("Authorization: nobody is let in with this token")
            raise UnauthorizedError("Authorization: Bearer and a token are needed, or a login")
        request.state.caller, request.state.token_id = caller, caller.token_id
        if not caller.may(need):
            raise ForbiddenError(
                f"scope: this needs {need}, {caller.name} has {', '.join(sorted(caller.scopes))}"
            )
        camera_id = parameters.get("camera_id")  # a bridge's heartbeat is about no camera
        if need == TokenScope.INGEST and camera_id is not None and not caller.may_post(camera_id):
            raise ForbiddenError(f"camera_id: {caller.name} posts for other cameras")

        def holds() -> bool:
            found = find(store)
            return found is not None and found.may(need)

        request.state.access_holds = holds
        if caller.token_id is not None:
            await self._keep_use(store, caller.token_id)

    async def _keep_use(self, store: Store, token_id: str) -> None:
        """Keep when a token was used last; a minute or so is near enough."""
        now_s = time.monotonic()
        last_s = self._used_s.get(token_id, -_USE_IS_KEPT_EVERY_S)
        # Who keeps one while the store is slow keeps no others waiting.
        if now_s - last_s < _USE_IS_KEPT_EVERY_S or self._keeping.available_tokens < 1:
            return
        self._used_s[token_id] = now_s

        def keep() -> None:
            with store.write(f"token/{token_id}") as session:
                access.note_use(session, token_id, datetime.now(UTC))

        try:
            await run_sync(keep, limiter=self._keeping)
        except (SQLAlchemyError, ServiceError) as error:  # a full disk must not keep readers out
            log.warning("token_use_not_kept", extra={"error": str(error)})


def still_let_in(request: Request) -> bool:
    """True while who asked may have the answer: asked again and again of one that goes on."""
    holds: Callable[[], bool] | None = getattr(request.state, "access_holds", None)
    return holds is None or holds()


def refuse(request: Request) -> None:
    """Note that somebody was not let in.

    Raises:
        TooManyRequestsError: that has happened too often from there.
    """
    failure = request.state.attempts.failed(request.state.address)
    if failure.worth_a_line:
        log.warning("login_refused", extra={"address": request.state.address})
        try:
            with request.state.app.store.write("refused/") as session:
                set_actor(session, None, request.state.address)  # and never with what
                note(session, Activity.LOGIN_REFUSED, by=None)
        except (SQLAlchemyError, ServiceError) as error:
            log.warning("refusal_not_kept", extra={"error": str(error)})
    if failure.wait_s:
        raise TooManyRequestsError(
            "token: " + _("too many were refused from this address"), retry_after_s=failure.wait_s
        )


def is_proxy(request: Request, settings: Settings) -> bool:
    """True of a request that comes from where a proxy of ours is."""
    try:
        peer = ip_address(request.client.host if request.client else "")
    except ValueError:
        return False
    return any(peer in network for network in settings.proxy_networks)


def address_of(request: Request, settings: Settings) -> str:
    """The address of a client, as far as can be known: through a proxy of ours, behind it."""
    forwarded = request.headers.get("x-forwarded-for", "").rpartition(",")[2].strip()
    if forwarded and is_proxy(request, settings):
        return forwarded[:64]
    return request.client.host if request.client else "unknown"


def _finder(request: Request, settings: Settings) -> Callable[[Store], Caller | None]:
    """The look for who asks; repeated while an answer goes on and on."""
    given = request.headers.get("authorization")
    vouched = _vouched_for(request, settings)
    cookie = request.cookies.get(COOKIE)

    def find(store: Store) -> Caller | None:
        if given is None and (vouched is not None or cookie is None):
            return vouched
        with store.read() as session:
            if given is None:
                return sessions.caller_of_session(session, cookie or "")
            scheme, _blank, token = given.partition(" ")
            if scheme.lower() != "bearer":
                return None
            return tokens.caller_of_token(session, token.strip())

    return find


def _vouched_for(request: Request, settings: Settings) -> Caller | None:
    """Whom a proxy of ours has logged in: it asks from its address, and says the secret."""
    secret = settings.proxy_secret
    said = request.headers.get(PROXY_HEADER, "")
    if secret is None or not is_proxy(request, settings):
        return None
    if not hmac.compare_digest(said.encode(), secret.encode()):
        return None
    name = request.headers.get(settings.proxy_user_header, "").strip()
    if not name:
        return None
    roles = request.headers.get(settings.proxy_role_header, "").replace(";", ",").split(",")
    known = {role.strip().lower() for role in roles} & (set(TokenScope) - {TokenScope.INGEST})
    # Whoever it lets through may look; more has to be said.
    return Caller(name=name[: tokens.MAX_NAME], scopes=frozenset(known or {TokenScope.READ}))


def _is_static(request: Request) -> bool:
    return request.method in ("GET", "HEAD") and request.url.path.startswith(f"{STATIC_URL}/")


def _looks_for_page(request: Request) -> bool:
    """True of a person who looks for a page, to be led to the login."""
    if request.method != "GET" or "authorization" in request.headers:
        return False
    if request.headers.get("sec-fetch-mode", "navigate") != "navigate":
        return False
    html = "text/html" in request.headers.get("accept", "")
    return html and not request.url.path.startswith(_PARTS)


def _to_login(request: Request) -> RedirectResponse:
    wanted = request.url.path + (f"?{request.url.query}" if request.url.query else "")
    where = "/ui/login" + ("" if wanted == "/" else f"?next={quote(wanted, safe='/')}")
    return RedirectResponse(where, status_code=303)
