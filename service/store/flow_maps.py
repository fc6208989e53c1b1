"""Statements on flow maps."""

from sqlalchemy.orm import Session

from service.store.tables.references import FlowMapRecord


def find(session: Session, reference_id: int) -> FlowMapRecord | None:
    """The flow map of a reference; None where none was learned yet."""
    return session.get(FlowMapRecord, reference_id)
