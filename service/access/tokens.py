"""Make and revoke tokens, and tell whose a token is."""

import hashlib
import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.activity import note
from service.addresses import origin_of
from service.enums import Activity, TokenScope
from service.errors import ForbiddenError, MalformedError, NotFoundError
from service.store import access
from service.store.access import Actor, TokenRecord
from service.wording.language import _

_PREFIX = "sf"
_SECRET_BYTES = 32
_NO_SECRET = hashlib.sha256(b"").hexdigest()
MAX_NAME = 200
# Each of these holds those before it; posting tracks is apart, so that a tracker's token reads
# nothing and an operator's invents no people.
_LADDER = (TokenScope.READ, TokenScope.OPERATE, TokenScope.ADMIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller(Actor):
    """Somebody who was let in.

    `token_id` is None where a proxy vouches for a person, `session_hash` where no page is logged
    in. `cameras` are those that tracks may be posted for, `sources` the names that they may be
    posted under; None: all, but for what is others' (`claims`).
    """

    scopes: frozenset[str]
    token_id: str | None = None
    session_hash: str | None = None
    cameras: frozenset[str] | None = None
    sources: frozenset[str] | None = None

    def may(self, scope: TokenScope) -> bool:
        """True if what needs a scope is allowed."""
        holding = _LADDER[_LADDER.index(scope) :] if scope in _LADDER else (scope,)
        return not self.scopes.isdisjoint(holding)

    def may_post(self, camera_id: str) -> bool:
        """True if tracks of a camera may be posted, as far as the camera goes."""
        return self.cameras is None or camera_id in self.cameras

    def require_sources(self, names: Sequence[str]) -> None:
        """Check that tracks may be posted under names, as far as the token names any.

        Raises:
            ForbiddenError: it names others.
        """
        for name in names:
            if self.sources is not None and name not in self.sources:
                raise ForbiddenError(
                    f"source: {self.name} posts under {', '.join(sorted(self.sources)):.200}, "
                    f"got {name!r:.60}"
                )

    def has_source(self, name: str) -> bool:
        """True if a source is one that the token names."""
        return self.sources is not None and name in self.sources


@dataclass(frozen=True, slots=True, kw_only=True)
class TokenSpec:
    """A token to make: whose, for what, for which cameras and sources (None: all), until when."""

    name: str
    scopes: Sequence[str]
    cameras: Sequence[str] | None = None
    sources: Sequence[str] | None = None
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
        secret_sha256=hash_of(secret),
        scopes=[scope for scope in TokenScope if scope in spec.scopes],
        cameras=None if spec.cameras is None else sorted(set(spec.cameras)),
        sources=None if spec.sources is None else sorted(set(spec.sources)),
        created_at=now,
        created_by=by,
        expires_at=spec.expires_at,
        used_at=None,
        revoked_at=None,
    )
    session.add(record)
    session.flush()
    details = {
        **{"name": record.name, "scopes": record.scopes},
        **{"cameras": record.cameras, "sources": record.sources},
    }
    note(session, Activity.TOKEN_ADDED, by=by, subject_id=token_id, details=details)
    return MadeToken(record=record, text=text_of(token_id, secret))


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
    prefix, _sign, rest = text.partition("_")
    token_id, _sign, secret = rest.partition("_")
    record = session.get(TokenRecord, token_id) if prefix == _PREFIX else None
    # The same work for a token that is unknown: its id is no secret, but need not be told.
    kept = _NO_SECRET if record is None else record.secret_sha256
    matches = hmac.compare_digest(kept, hash_of(secret))
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
        sources=None if record.sources is None else frozenset(record.sources),
    )


def address_for(caller: Caller | None, url: str | None) -> str | None:
    """A stored address as a caller sees it.

    It is whole for `admin`, or if access control is off (`caller` is None); others see scheme,
    host and port.
    """
    if url is None or caller is None or caller.may(TokenScope.ADMIN):
        return url
    return origin_of(url)


def is_valid(record: TokenRecord, now: datetime) -> bool:
    """True of a token that is neither revoked nor over."""
    return record.revoked_at is None and (record.expires_at is None or now < record.expires_at)


def text_of(token_id: str, secret: str) -> str:
    """A token as it is said."""
    return f"{_PREFIX}_{token_id}_{secret}"


def hash_of(secret: str) -> str:
    """The SHA-256 that stands for a secret of ours."""
    # 32 random bytes need no slow hash: nobody guesses them.
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()


def _check(spec: TokenSpec, now: datetime) -> None:
    unknown = [scope for scope in spec.scopes if scope not in list(TokenScope)]
    refuse = MalformedError.of_field
    if not 0 < len(spec.name.strip()) <= MAX_NAME:
        count = len(spec.name.strip())
        raise refuse("name", _("1 to {n} characters are needed, got {got}", n=MAX_NAME, got=count))
    if not spec.name.isprintable():
        raise refuse("name", _("letters that can be printed, on one line, are needed"))
    if unknown or not spec.scopes:
        got = ", ".join(unknown)[:80] or _("none")
        scopes = ", ".join(TokenScope)
        raise refuse("scopes", _("some of {scopes} are needed, got {got}", scopes=scopes, got=got))
    for field, named in (("cameras", spec.cameras), ("sources", spec.sources)):
        if named is not None and (TokenScope.INGEST not in spec.scopes or not named):
            raise refuse(
                field, _("{field} are named for the scope ingest alone, one at least", field=field)
            )
    for name in spec.sources or ():
        if not 0 < len(name) <= MAX_NAME or not name.isprintable():
            got = f"{name!r:.80}"
            raise refuse(
                "sources", _("1 to {n} printable characters each, got {got}", n=MAX_NAME, got=got)
            )
    if spec.expires_at is not None and spec.expires_at <= now:
        got = spec.expires_at.isoformat()
        raise refuse("expires_at", _("a time after now is needed, got {got}", got=got))
