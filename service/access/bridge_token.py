"""The token of the bridge that `serve` runs: made by `serve`, known to nobody else.

There is one record of it, which keeps the sources that the bridge has posted under; each start has
a new secret, which is in the memory of `serve` and of the bridge alone.
"""

import secrets
from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.activity import note
from service.access.tokens import hash_of, text_of
from service.enums import Activity, TokenScope
from service.store.access import TokenRecord

TOKEN_ID = "bridge"  # others are hexadecimal
_NAME = "bridge of serve"
_SECRET_BYTES = 32


def renew_bridge_token(session: Session) -> str | None:
    """The bridge's token, with a new secret; None where somebody has revoked it.

    It may read, and post tracks of cameras that no other token names.
    """
    secret = secrets.token_urlsafe(_SECRET_BYTES)
    record = session.get(TokenRecord, TOKEN_ID)
    if record is None:
        scopes = [TokenScope.READ, TokenScope.INGEST]
        record = TokenRecord(
            id=TOKEN_ID,
            name=_NAME,
            secret_sha256=hash_of(secret),
            scopes=[scope for scope in TokenScope if scope in scopes],
            created_at=datetime.now(UTC),
            created_by="serve",
        )
        session.add(record)
        session.flush()
        details = {"name": _NAME, "scopes": record.scopes, "cameras": None, "sources": None}
        note(session, Activity.TOKEN_ADDED, by="serve", subject_id=TOKEN_ID, details=details)
    elif record.revoked_at is not None:
        return None
    record.secret_sha256 = hash_of(secret)
    return text_of(TOKEN_ID, secret)
