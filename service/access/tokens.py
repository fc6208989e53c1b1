"""Make, list and revoke tokens, and tell whose a token is."""

import hashlib
import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.activity import note
from service.access.callers import Caller
from service.enums import Activity, TokenScope
from service.errors import FieldError, MalformedError, NotFoundError
from service.store import access
from service.store.access import TokenRecord

_PREFIX = "sf"
_SECRET_BYTES = 32
_NO_SECRET = hashlib.sha256(b"").hexdigest()
MAX_NAME = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class TokenSpec:
    """A token to make: whose, for what, for which cameras (None: all), until when."""

    name: str
    scopes: tuple[str, ...]
    cameras: tuple[str, ...] | None = None
    expires_at: datetime | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeToken:
    """A new token: the record, and the text that is shown this once."""

    record: TokenRecord
    text: str


def make_token(session: Session, spec: TokenSpec, by: str | None) -> MadeToken:
    """Store a new token.

    Raises:
        MalformedError: it would be for nothing, for nobody, or over already.
    """
    now = datetime.now(UTC)
    _check(spec, now)
    token_id, secret = secrets.token_hex(6), secrets.token_urlsafe(_SECRET_BYTES)
    record = TokenRecord(
        id=token_id,
        name=spec.name.strip(),
        secret_sha256=_hash(secret),
        scopes=[scope for scope in TokenScope if scope in spec.scopes],
        cameras=None if spec.cameras is None else sorted(set(spec.cameras)),
        created_at=now,
        created_by=by,
        expires_at=spec.expires_at,
        used_at=None,
        revoked_at=None,
    )
    session.add(record)
    session.flush()
    details = {"name": record.name, "scopes": record.scopes, "cameras": record.cameras}
    note(session, Activity.TOKEN_ADDED, by=by, subject_id=token_id, details=details)
    return MadeToken(record=record, text=f"{_PREFIX}_{token_id}_{secret}")


def list_tokens(session: Session) -> Sequence[TokenRecord]:
    """All tokens, oldest first, revoked ones too."""
    return access.every(session)


def count_tokens(session: Session) -> int:
    """The number of tokens that would be let in now."""
    return access.count_valid(session, datetime.now(UTC))


def revoke_token(session: Session, token_id: str, by: str | None) -> TokenRecord:
    """Let a token in no more, and log out its pages; one that was revoked stays so.

    Raises:
        NotFoundError: there is none of that id.
    """
    record = session.get(TokenRecord, token_id)
    if record is None:
        raise NotFoundError(f"token_id: there is no token {token_id!r:.80}")
    if record.revoked_at is None:
        record.revoked_at = datetime.now(UTC)
        details = {"name": record.name}
        note(session, Activity.TOKEN_REVOKED, by=by, subject_id=token_id, details=details)
    access.end_sessions(session, token_id=token_id)
    return record


def caller_of_token(session: Session, text: str) -> Caller | None:
    """The caller with a token; None where nobody is let in with it."""
    prefix, _, rest = text.partition("_")
    token_id, _, secret = rest.partition("_")
    record = session.get(TokenRecord, token_id) if prefix == _PREFIX else None
    # The same work for a token that is unknown: its id is no secret, but need not be told.
    kept = _NO_SECRET if record is None else record.secret_sha256
    matches = hmac.compare_digest(kept, _hash(secret))
    if record is None or not matches or not is_valid(record, datetime.now(UTC)):
        return None
    return caller_of(record)


def caller_of(record: TokenRecord) -> Caller:
    """The caller that a token stands for."""
    return Caller(
        name=record.name,
        scopes=frozenset(record.scopes),
        token_id=record.id,
        cameras=None if record.cameras is None else frozenset(record.cameras),
    )


def is_valid(record: TokenRecord, now: datetime) -> bool:
    """True of a token that is neither revoked nor over."""
    return record.revoked_at is None and (record.expires_at is None or now < record.expires_at)


def note_use(session: Session, token_id: str) -> None:
    """Keep that a token was used now."""
    access.note_use(session, token_id, datetime.now(UTC))


def _hash(secret: str) -> str:
    # 32 random bytes need no slow hash: nobody guesses them.
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()


def _check(spec: TokenSpec, now: datetime) -> None:
    unknown = [scope for scope in spec.scopes if scope not in list(TokenScope)]
    if not 0 < len(spec.name.strip()) <= MAX_NAME:
        _refuse("name", f"1 to {MAX_NAME} characters are needed, got {len(spec.name.strip())}")
    if not spec.name.isprintable():
        _refuse("name", "letters that can be printed, on one line, are needed")
    if unknown or not spec.scopes:
        got = ", ".join(unknown) or "none"
        _refuse("scopes", f"some of {', '.join(TokenScope)} are needed, got {got:.80}")
    if spec.cameras is not None and (TokenScope.INGEST not in spec.scopes or not spec.cameras):
        _refuse("cameras", "cameras are named for the scope ingest alone, one at least")
    if spec.expires_at is not None and spec.expires_at <= now:
        _refuse("expires_at", f"a time after now is needed, got {spec.expires_at.isoformat()}")


def _refuse(name: str, reason: str) -> None:
    raise MalformedError(f"{name}: {reason}", (FieldError(pointer=f"/{name}", reason=reason),))
