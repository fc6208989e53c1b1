"""Sessions of pages: who logs in with a token is known by a cookie until the session ends."""

import secrets
from dataclasses import replace
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.access.activity import note
from service.access.tokens import Caller, caller_of, caller_of_token, hash_of, is_valid
from service.enums import Activity, TokenScope
from service.errors import ForbiddenError, UnauthorizedError
from service.settings import Settings
from service.store import access
from service.store.access import SessionRecord
from service.wording.language import _

_ID_BYTES = 32


def check_login(session: Session, token: str) -> Caller:
    """Whom a token stands for, who may look at pages.

    Raises:
        UnauthorizedError: nobody is let in with it.
        ForbiddenError: it is not for pages.
    """
    caller = caller_of_token(session, token.strip())
    if caller is None:
        raise UnauthorizedError(
            "token: " + _("nobody is let in with this; it may be over or revoked")
        )
    if not caller.may(TokenScope.READ):
        raise ForbiddenError(
            "token: " + _("pages need the scope read, this is for posting tracks alone")
        )
    return caller


def log_in(session: Session, settings: Settings, caller: Caller) -> str:
    """Begin a session of who was let in with a token; returns what its cookie says."""
    assert caller.token_id is not None
    now = datetime.now(UTC)
    access.forget_sessions(session, now)
    cookie = secrets.token_urlsafe(_ID_BYTES)
    session.add(
        SessionRecord(
            id_sha256=hash_of(cookie),
            token_id=caller.token_id,
            created_at=now,
            expires_at=now + timedelta(hours=settings.session_hours),
        )
    )
    _note(session, Activity.SESSION_BEGAN, caller)
    return cookie


def log_out(session: Session, caller: Caller) -> None:
    """End the session of a page."""
    if caller.session_hash is None:
        return
    access.end_session(session, caller.session_hash)
    _note(session, Activity.SESSION_ENDED, caller)


def caller_of_session(session: Session, cookie: str) -> Caller | None:
    """The caller whose page asks; None where its session, or the token behind it, is over."""
    id_sha256 = hash_of(cookie)
    found = access.session_with_token(session, id_sha256)
    now = datetime.now(UTC)
    if found is None or found[0].expires_at <= now or not is_valid(found[1], now):
        return None
    return replace(caller_of(found[1]), session_hash=id_sha256)


def _note(session: Session, what: Activity, caller: Caller) -> None:
    token_id = caller.token_id
    note(session, what, by=caller.name, via=token_id, subject_id=token_id)
