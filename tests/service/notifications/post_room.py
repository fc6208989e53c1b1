"""A camera with alerts, a webhook and the delivery job run by hand."""

import math
from datetime import datetime
from typing import Any

from sqlalchemy import text

from service.alerts import alerts
from service.job_queue import JobQueue
from service.notifications import deliveries
from service.reasons import as_said
from service.store.engines.store import Store
from service.store.webhooks import WebhookRecord
from service.workers.context import JobContext
from service.workers.deliver import run_deliver
from tests.conftest import CAMERA


class PostRoom:
    """What a test of deliveries needs of the service."""

    def __init__(self, http: Any, settings: Any) -> None:
        self.http, self.settings = http, settings
        self.store = Store(settings)
        queue = JobQueue(self.store.engine)
        self.context = JobContext(settings=settings, store=self.store, queue=queue)
        http.post("/cameras", json=CAMERA).raise_for_status()

    def hook(self, url: str, **more: Any) -> dict[str, Any]:
        answer = self.http.post("/webhooks", json={"url": url, **more})
        assert answer.status_code == 201, answer.text
        body: dict[str, Any] = answer.json()
        return body

    def open(
        self,
        kind: str = "drift",
        severity: str = "warning",
        changed_at: datetime | None = None,
        **more: Any,
    ) -> str:
        drift = {"tilt_rad": math.radians(5.0), "angle_rad": math.radians(5.0)}
        with self.store.write() as session:
            record = alerts.open_alert(
                session,
                self.settings,
                "corner",
                kind,
                severity,
                drift,
                changed_at,
                reasons=as_said("tilt +5.00 deg"),
                **more,
            )
        return record.id

    def end(self, kind: str = "drift") -> None:
        with self.store.write() as session:
            alerts.end_alert(session, "corner", kind, "cleared")

    def send(self, hook: dict[str, Any]) -> None:
        """Run the job that waits for a webhook."""
        self.take(hook)
        run_deliver(self.context, hook["id"])

    def take(self, hook: dict[str, Any]) -> None:
        """Have the engine take up the job that waits for a webhook."""
        with self.store.write() as session:
            session.execute(
                text(
                    "UPDATE workflow_status SET status = 'PENDING' "
                    "WHERE queue_name = 'deliver' AND queue_partition_key = :hook"
                ),
                {"hook": hook["id"]},
            )

    def send_now(self, hook: dict[str, Any]) -> None:
        """The same when the time of everything that waits has come."""
        with self.store.write() as session:
            session.execute(text("UPDATE webhooks SET held_until = NULL"))
            session.execute(
                text(
                    "UPDATE deliveries SET next_attempt_at = queued_at "
                    "WHERE next_attempt_at IS NOT NULL"
                )
            )
        self.send(hook)

    def show(self, hook: dict[str, Any]) -> dict[str, Any]:
        body: dict[str, Any] = self.http.get(f"/webhooks/{hook['id']}").json()
        return body

    def log(self, hook: dict[str, Any], **query: Any) -> list[dict[str, Any]]:
        """Deliveries, newest first."""
        answer = self.http.get(f"/webhooks/{hook['id']}/deliveries", params=query)
        items: list[dict[str, Any]] = answer.json()["items"]
        return items

    def jobs(self) -> list[str]:
        """The webhooks for which a job is queued in the engine."""
        with self.store.read() as session:
            rows = session.execute(
                text("SELECT queue_partition_key FROM workflow_status WHERE queue_name = 'deliver'")
            )
            return [row[0] for row in rows]

    def change(self, hook: dict[str, Any], **values: Any) -> None:
        """Set what only time would."""
        with self.store.write() as session:
            record = session.get(WebhookRecord, hook["id"])
            for name, value in values.items():
                setattr(record, name, value)

    def awaited(self) -> list[str]:
        with self.store.read() as session:
            return deliveries.awaited(session, self.settings)
