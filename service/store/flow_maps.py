"""Statements on flow maps, on anchors, the first of them, and on last poses by them."""

from sqlalchemy.orm import Session

from service.store.tables.references import AnchorRecord, FlowMapRecord, LastPoseRecord


def find(session: Session, reference_id: int) -> FlowMapRecord | None:
    """The flow map of a reference; None where none was learned yet."""
    return session.get(FlowMapRecord, reference_id)


def anchor(session: Session, reference_id: int) -> AnchorRecord | None:
    """The anchor of a reference; None where none could be learned yet."""
    return session.get(AnchorRecord, reference_id)


def last_pose(session: Session, reference_id: int) -> LastPoseRecord | None:
    """Where the next estimate against a reference may begin; None where it is to look anew."""
    return session.get(LastPoseRecord, reference_id)
