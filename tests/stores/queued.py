"""The cameras that a look is queued or under way for, those first whose turn is first."""

from sqlalchemy import text
from sqlalchemy.orm import Session

_QUEUED = text(
    "SELECT deduplication_id FROM workflow_status "
    "WHERE queue_name = 'estimate' AND deduplication_id IS NOT NULL ORDER BY priority, created_at"
)


def queued_cameras(session: Session) -> list[str]:
    """Their ids."""
    return list(session.scalars(_QUEUED))
