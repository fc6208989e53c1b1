"""An alert that a person has answered."""

from datetime import UTC, datetime

from service.store.alerts import AlertRecord


def put_back(changed_s):
    """The alert of a move that was put right by now."""
    now = datetime.now(UTC)
    return AlertRecord(
        id="a" * 32,
        camera_id="corner",
        kind="drift",
        state="resolved",
        source="estimate",
        severity="warning",
        reasons=(),
        drift={},
        opened_at=now,
        changed_at=datetime.fromtimestamp(changed_s, UTC),
        updated_at=now,
        resolved_at=now,
        outcome="put_back",
    )
