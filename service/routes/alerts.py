"""`/alerts`: list, show, acknowledge, resolve."""

from typing import Annotated, Literal

from fastapi import APIRouter, Query

from service.recalibration import alerts
from service.routes.state import ReadDep, WriteDep
from service.schemas.alerts import AcknowledgeBody, AlertList, AlertOut, ResolveBody

router = APIRouter(prefix="/alerts", tags=["alerts"])


@router.get("")
def list_all(
    session: ReadDep,
    state: Literal["firing", "resolved"] | None = None,
    camera_id: str | None = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> AlertList:
    """Alerts, newest first."""
    records = alerts.list_alerts(session, state, camera_id, limit)
    return AlertList(items=[AlertOut.from_record(record) for record in records])


@router.get("/{alert_id}")
def show(alert_id: str, session: ReadDep) -> AlertOut:
    """An alert."""
    return AlertOut.from_record(alerts.show_alert(session, alert_id))


@router.post("/{alert_id}/acknowledge")
def acknowledge(alert_id: str, session: WriteDep, body: AcknowledgeBody | None = None) -> AlertOut:
    """Note who has seen an alert."""
    by = None if body is None else body.by
    return AlertOut.from_record(alerts.acknowledge_alert(session, alert_id, by))


@router.post("/{alert_id}/resolve")
def resolve(alert_id: str, body: ResolveBody, session: WriteDep) -> AlertOut:
    """End an alert with what came of it."""
    return AlertOut.from_record(
        alerts.resolve_alert(session, alert_id, body.outcome, body.note, body.by)
    )
