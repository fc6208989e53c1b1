"""Tokens, sessions of pages, and the person in whose name a session writes."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import JSON, ColumnElement, ForeignKey, Index, String, delete, or_, select, update
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.store.record import Record, count_where


class TokenRecord(Record):
    """A token; of its secret, the SHA-256 alone. A revoked one stays, so that the log has names."""

    __tablename__ = "access_tokens"

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    name: Mapped[str]
    secret_sha256: Mapped[str] = mapped_column(String(64))
    scopes: Mapped[list[str]]
    cameras: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))  # None: all
    sources: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))  # None: all
    created_at: Mapped[datetime]
    created_by: Mapped[str | None]
    expires_at: Mapped[datetime | None]
    used_at: Mapped[datetime | None]  # to the minute
    revoked_at: Mapped[datetime | None]


class SessionRecord(Record):
    """A page that is logged in, known by the SHA-256 of what its cookie says."""

    __tablename__ = "access_sessions"

    id_sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    token_id: Mapped[str] = mapped_column(ForeignKey("access_tokens.id", ondelete="CASCADE"))
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]

    __table_args__ = (Index(None, "token_id"), Index(None, "expires_at"))


def every(session: Session) -> Sequence[TokenRecord]:
    """All tokens, oldest first."""
    query = select(TokenRecord).order_by(TokenRecord.created_at, TokenRecord.id)
    return session.scalars(query).all()


def valid(session: Session, now: datetime) -> Sequence[TokenRecord]:
    """The tokens that are valid, oldest first."""
    query = select(TokenRecord).where(*_valid(now))
    return session.scalars(query.order_by(TokenRecord.created_at, TokenRecord.id)).all()


def count_valid(session: Session, now: datetime, besides: str) -> int:
    """The number of tokens that are valid, besides one."""
    return count_where(session, *_valid(now), TokenRecord.id != besides)


def _valid(now: datetime) -> tuple[ColumnElement[bool], ...]:
    fresh = or_(TokenRecord.expires_at.is_(None), TokenRecord.expires_at > now)
    return TokenRecord.revoked_at.is_(None), fresh


def note_use(session: Session, token_id: str, now: datetime) -> None:
    """Keep that a token was used."""
    session.execute(update(TokenRecord).where(TokenRecord.id == token_id).values(used_at=now))


def session_with_token(
    session: Session, id_sha256: str
) -> tuple[SessionRecord, TokenRecord] | None:
    """A page's session and its token, or None."""
    query = select(SessionRecord, TokenRecord).join(
        TokenRecord, TokenRecord.id == SessionRecord.token_id
    )
    row = session.execute(query.where(SessionRecord.id_sha256 == id_sha256)).first()
    return None if row is None else (row[0], row[1])


def end_sessions(session: Session, *, token_id: str) -> None:
    """Log out all pages of a token."""
    session.execute(delete(SessionRecord).where(SessionRecord.token_id == token_id))


def end_session(session: Session, id_sha256: str) -> None:
    """Log out one page."""
    session.execute(delete(SessionRecord).where(SessionRecord.id_sha256 == id_sha256))


def forget_sessions(session: Session, now: datetime) -> None:
    """Delete sessions that are over."""
    session.execute(delete(SessionRecord).where(SessionRecord.expires_at <= now))


_KEY, _ADDRESS = "surefoot.actor", "surefoot.address"


@dataclass(frozen=True, slots=True, kw_only=True)
class Actor:
    """A person who is known, and the token that stands for it."""

    name: str
    token_id: str | None


def set_actor(session: Session, actor: Actor | None, address: str | None) -> None:
    """Let a session write in somebody's name, who asks from an address."""
    session.info[_KEY], session.info[_ADDRESS] = actor, address


def name_in(session: Session, said: str | None) -> str | None:
    """The name that a session writes in, and where that is not known, the one that is said."""
    actor = actor_of(session)
    return said if actor is None else actor.name


def actor_of(session: Session) -> Actor | None:
    """In whose name a session writes; None where nobody is known, or the service acts."""
    actor: Actor | None = session.info.get(_KEY)
    return actor


def address_of(session: Session) -> str | None:
    """The address from which somebody asks for what a session writes; None where nobody does."""
    address: str | None = session.info.get(_ADDRESS)
    return address
