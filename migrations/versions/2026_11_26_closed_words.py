"""States, kinds, outcomes and severities are of closed vocabularies, which the store checks."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_26_closed_words"
down_revision = "2026_11_25_track_sources"
branch_labels = None
depends_on = None

_KINDS = ("drift", "no_data", "out_of_range", "clock", "stale", "tracker")
_OUTCOMES = ("put_back", "accepted", "false_alarm", "cleared", "camera_removed")
_ALERT_ACTS = ("opened", "escalated", "acknowledged", "silenced", "silence_ended", "resolved")
_ACTS = {
    "camera": ("registered", "changed", "removed"),
    "pose": ("accepted", "put_back", "false_alarm"),
    "reference": ("reset", "learned"),
    "source": ("used", "removed"),
    "alert": _ALERT_ACTS,
    "maintenance": ("planned", "changed", "ended", "withdrawn", "over"),
    "training": ("requested", "succeeded", "failed", "cancelled"),
    "snapshot": ("kept", "removed"),
    "webhook": ("added", "changed", "secret_changed", "removed", "tested", "replayed"),
    "token": ("added", "revoked"),
    "session": ("began", "ended"),
    "login": ("refused",),
}
_WORDS: dict[str, dict[str, tuple[str, ...]]] = {
    "prior_poses": {"origin": ("registered", "changed", "accepted")},
    "site_references": {
        "origin": ("registered", "changed", "accepted", "reset", "put_back", "source"),
        "answer": ("put_back", "false_alarm"),
    },
    "trainings": {"state": ("queued", "running", "succeeded", "failed", "cancelled")},
    "estimates": {"state": ("learning", "ok", "drifting", "out_of_range")},
    "alerts": {
        "kind": _KINDS,
        "state": ("firing", "resolved"),
        "source": ("estimate", "reference", "rhythm", "upkeep", "group", "tracks"),
        "severity": ("warning", "critical"),
        "outcome": _OUTCOMES,
    },
    "events": {"type": ("pose", "alert", "training")},
    "webhooks": {"format": ("webhook", "alertmanager")},
    "deliveries": {
        "type": (
            "alert.opened",
            "alert.updated",
            "alert.acknowledged",
            "alert.silenced",
            "alert.resolved",
            "test",
        ),
        "state": ("pending", "delivered", "failed"),
    },
    "activity": {
        "what": tuple(f"{subject}.{verb}" for subject, verbs in _ACTS.items() for verb in verbs),
        "kind": _KINDS,
        "outcome": _OUTCOMES,
    },
}
_NUMBERED = ("events", "deliveries", "activity")  # whose ids are never given twice


def upgrade() -> None:
    for table, columns in _WORDS.items():
        _remake(table, columns, add=True)


def downgrade() -> None:
    for table, columns in _WORDS.items():
        _remake(table, columns, add=False)


def _remake(table: str, columns: dict[str, tuple[str, ...]], *, add: bool) -> None:
    """Make a table anew with or without its checks; its triggers and its numbering stay."""
    connection = op.get_bind()
    said = {"name": table}
    triggers = connection.scalars(
        sa.text("SELECT sql FROM sqlite_master WHERE type = 'trigger' AND tbl_name = :name"), said
    ).all()
    numbered, last = table in _NUMBERED, None
    if numbered:
        number = sa.text("SELECT seq FROM sqlite_sequence WHERE name = :name")
        last = connection.scalar(number, said)
    with op.batch_alter_table(table, table_kwargs={"sqlite_autoincrement": numbered}) as batch:
        for column, words in columns.items():
            name = op.f(f"ck_{table}_{column}")
            if add:
                one_of = ", ".join(f"'{word}'" for word in words)
                batch.create_check_constraint(name, f"{column} IN ({one_of})")
            else:
                batch.drop_constraint(name, type_="check")
    for sql in triggers:
        op.execute(sql)
    if last is not None:
        connection.execute(sa.text("DELETE FROM sqlite_sequence WHERE name = :name"), said)
        connection.execute(
            sa.text("INSERT INTO sqlite_sequence (name, seq) VALUES (:name, :last)"),
            {**said, "last": last},
        )
