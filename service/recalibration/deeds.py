"""Who did what when at a camera: alerts, poses, references and maintenance in one story."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from service.store import acts, cameras, maintenance, references
from service.store.tables import AlertRecord

_MOST = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Deed:
    """What was done; `by` is None where the service did it by itself, or nobody said a name.

    `what` is the act or the origin of a pose or reference. `kind` is the alert's, `until` of a
    silence or of maintenance, `outcome` of an alert.
    """

    at: datetime
    what: str
    by: str | None
    kind: str | None = None
    until: datetime | None = None
    outcome: str | None = None
    note: str | None = None


def deeds_of(session: Session, camera_id: str, of: Sequence[AlertRecord]) -> tuple[Deed, ...]:
    """What was done at a camera and with some alerts, newest first.

    An act that made several records is told once: accepting a pose ends alerts and begins a
    reference.
    """
    kinds = {record.id: record.kind for record in of}
    deeds = [
        Deed(
            at=act.at,
            what=act.act,
            by=act.by,
            kind=kinds[act.alert_id],
            until=act.until,
            outcome=act.outcome,
            note=act.note,
        )
        for act in acts.of_alerts(session, list(kinds))
    ]
    deeds += [Deed(at=record.opened_at, what="opened", by=None, kind=record.kind) for record in of]
    deeds += [
        Deed(at=prior.created_at, what=prior.origin, by=prior.trusted_by)
        for prior in cameras.prior_poses(session, camera_id, _MOST)
    ]
    for reference in references.of_camera(session, camera_id, _MOST):
        if reference.origin == "reset":
            deeds.append(Deed(at=reference.created_at, what="reset", by=reference.requested_by))
        if reference.ready_at is not None:
            deeds.append(Deed(at=reference.ready_at, what="learned", by=None))
    deeds += [
        Deed(
            at=window.created_at,
            what="maintenance",
            by=window.requested_by,
            until=window.to_at,
            note=window.reason,
        )
        for window in maintenance.of_camera(session, camera_id)
    ]
    return tuple(sorted(deeds, key=lambda deed: deed.at, reverse=True)[:_MOST])
