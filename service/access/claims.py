"""Whose a source is: under what one token posts, no other token lies.

The name of a camera's source is the token's that posted under it first, until that one is revoked
or over; tokens that name the source (`sources`) have it together, and nobody else. A camera that
tokens name (`cameras`) is claimed by these alone: the first source that counts is one of theirs.
"""

from datetime import UTC, datetime

from sqlalchemy.orm import Session

from service.access.tokens import Caller
from service.enums import TokenScope
from service.errors import ForbiddenError
from service.store import access
from service.store.access import TokenRecord


def require_own(
    session: Session, caller: Caller | None, camera_id: str, source: str, holder_id: str | None
) -> None:
    """Refuse a name that is another's. `holder_id` is the token that posted under it last.

    Raises:
        ForbiddenError: it is.
    """
    if caller is None or caller.has_source(source):
        return
    posting = _posting(session, camera_id)
    holders = [token for token in posting if source in (token.sources or ())]
    holders += [token for token in posting if token.id == holder_id != caller.token_id]
    if holders:
        raise ForbiddenError(
            f"source: {source!r:.60} of camera {camera_id!r} is under what the token of "
            f"{holders[0].name} posts; post under another name, or by a token that names this one"
        )


def require_claim(session: Session, caller: Caller | None, camera_id: str) -> None:
    """Refuse the first post for a camera that is others' to claim.

    Raises:
        ForbiddenError: it is.
    """
    if caller is not None and not may_claim(session, caller.token_id, camera_id):
        raise ForbiddenError(
            f"source: none of camera {camera_id!r} counts yet, and the first has to be posted by "
            f"a token that names the camera, as the one of {caller.name} does not"
        )


def may_claim(session: Session, token_id: str | None, camera_id: str) -> bool:
    """True if what a token posts may come to count by itself; so may what none does."""
    named = {
        token.id for token in _posting(session, camera_id) if camera_id in (token.cameras or ())
    }
    return token_id is None or not named or token_id in named


def _posting(session: Session, camera_id: str) -> list[TokenRecord]:
    """The valid tokens that may post tracks of a camera."""
    return [
        token
        for token in access.valid(session, datetime.now(UTC))
        if TokenScope.INGEST in token.scopes
        and (token.cameras is None or camera_id in token.cameras)
    ]
