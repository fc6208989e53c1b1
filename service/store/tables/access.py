"""Records of who may do what: tokens, and the sessions of pages."""

from datetime import datetime

from sqlalchemy import JSON, ForeignKey, Index, String
from sqlalchemy.orm import Mapped, mapped_column

from service.store.tables.record import Record


class TokenRecord(Record):
    """A token; of its secret, the SHA-256 alone. A revoked one stays, so that the log has names."""

    __tablename__ = "access_tokens"

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    name: Mapped[str]
    secret_sha256: Mapped[str] = mapped_column(String(64))
    scopes: Mapped[list[str]]
    cameras: Mapped[list[str] | None] = mapped_column(JSON(none_as_null=True))  # None: all
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
