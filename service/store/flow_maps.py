"""Statements on flow maps and on anchors, the first of them."""

from sqlalchemy.orm import Session

from service.store.tables.references import AnchorRecord, FlowMapRecord


def find(session: Session, reference_id: int) -> FlowMapRecord | None:
    """The flow map of a reference; None where none was learned yet."""
    return session.get(FlowMapRecord, reference_id)


def anchor(session: Session, reference_id: int) -> AnchorRecord | None:
    """The anchor of a reference; None where none could be learned yet."""
    return session.get(AnchorRecord, reference_id)
