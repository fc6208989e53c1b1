"""Statements on tokens and sessions."""

from collections.abc import Sequence
from datetime import datetime

from sqlalchemy import delete, func, or_, select, update
from sqlalchemy.orm import Session

from service.store.tables.access import SessionRecord, TokenRecord


def find(session: Session, token_id: str) -> TokenRecord | None:
    """The token, or None."""
    return session.get(TokenRecord, token_id)


def every(session: Session) -> Sequence[TokenRecord]:
    """All tokens, oldest first."""
    query = select(TokenRecord).order_by(TokenRecord.created_at, TokenRecord.id)
    return session.scalars(query).all()


def count_valid(session: Session, now: datetime) -> int:
    """How many tokens would be let in."""
    query = select(func.count()).select_from(TokenRecord)
    fresh = or_(TokenRecord.expires_at.is_(None), TokenRecord.expires_at > now)
    return session.scalar(query.where(TokenRecord.revoked_at.is_(None), fresh)) or 0


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
