"""One log of what was done, which only grows; what is known of the past is carried over."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_activity"
down_revision = "2026_11_22_snapshots"
branch_labels = None
depends_on = None

_COLUMNS = "at, what, by, camera_id, subject_id, kind, until, outcome, note"
# Of alerts that were opened and ended before there were acts, these times alone are known.
_PAST = """
    SELECT opened_at, 'alert.opened', NULL, camera_id, id, kind, NULL, NULL, NULL FROM alerts
    UNION ALL
    SELECT act.at, 'alert.' || act.act, act.by, alerts.camera_id, alerts.id, alerts.kind, act.until,
           act.outcome, act.note
    FROM alert_acts AS act JOIN alerts ON alerts.id = act.alert_id
    UNION ALL
    SELECT resolved_at, 'alert.resolved', resolved_by, camera_id, id, kind, NULL, outcome, note
    FROM alerts WHERE resolved_at IS NOT NULL AND id NOT IN (
        SELECT alert_id FROM alert_acts WHERE act = 'resolved')
    UNION ALL
    SELECT created_at,
           CASE origin WHEN 'accepted' THEN 'pose.accepted' ELSE 'camera.' || origin END,
           trusted_by, camera_id, NULL, NULL, NULL, NULL, NULL
    FROM prior_poses
    UNION ALL
    SELECT created_at, 'reference.reset', requested_by, camera_id, NULL, NULL, NULL, NULL, NULL
    FROM site_references WHERE origin = 'reset'
    UNION ALL
    SELECT ready_at, 'reference.learned', NULL, camera_id, NULL, NULL, NULL, NULL, NULL
    FROM site_references WHERE ready_at IS NOT NULL
    UNION ALL
    SELECT created_at, 'maintenance.planned', requested_by, camera_id, id, NULL, to_at, NULL, reason
    FROM maintenance_windows
    UNION ALL
    SELECT finished_at, 'training.' || state, NULL, camera_id, id, NULL, NULL, NULL, error
    FROM trainings WHERE finished_at IS NOT NULL
    UNION ALL
    SELECT stored_at, 'snapshot.kept', NULL, camera_id, NULL, NULL, NULL, NULL, NULL FROM snapshots
"""


def upgrade() -> None:
    op.create_table(
        "activity",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("at", sa.DateTime(), nullable=False),
        sa.Column("what", sa.String(), nullable=False),
        sa.Column("by", sa.String(), nullable=True),
        sa.Column("via", sa.String(), nullable=True),
        sa.Column("camera_id", sa.String(length=64), nullable=True),
        sa.Column("subject_id", sa.String(length=64), nullable=True),
        sa.Column("kind", sa.String(), nullable=True),
        sa.Column("until", sa.DateTime(), nullable=True),
        sa.Column("outcome", sa.String(), nullable=True),
        sa.Column("note", sa.String(), nullable=True),
        sa.Column("details", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_activity")),
        sqlite_autoincrement=True,
    )
    op.create_index(op.f("ix_activity_camera_id_id"), "activity", ["camera_id", "id"])
    op.create_index(op.f("ix_activity_subject_id_id"), "activity", ["subject_id", "id"])
    op.create_index(op.f("ix_activity_at"), "activity", ["at"])
    op.execute(
        f"INSERT INTO activity ({_COLUMNS}, details) SELECT *, '{{}}' FROM ({_PAST}) ORDER BY 1"
    )
    op.execute(
        "CREATE TRIGGER activity_unchanged BEFORE UPDATE ON activity "
        "BEGIN SELECT RAISE(ABORT, 'activity: entries are never changed'); END"
    )
    op.execute(
        "CREATE TRIGGER activity_kept BEFORE DELETE ON activity "
        "WHEN OLD.at > strftime('%Y-%m-%d %H:%M:%f', 'now', '-30 days') "
        "BEGIN SELECT RAISE(ABORT, 'activity: entries of the last 30 days are kept'); END"
    )
    op.drop_table("alert_acts")


def downgrade() -> None:
    op.create_table(
        "alert_acts",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("alert_id", sa.String(length=32), nullable=False),
        sa.Column("act", sa.String(), nullable=False),
        sa.Column("by", sa.String(), nullable=True),
        sa.Column("until", sa.DateTime(), nullable=True),
        sa.Column("outcome", sa.String(), nullable=True),
        sa.Column("note", sa.String(), nullable=True),
        sa.Column("at", sa.DateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["alert_id"],
            ["alerts.id"],
            name=op.f("fk_alert_acts_alert_id_alerts"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_alert_acts")),
    )
    op.create_index(op.f("ix_alert_acts_alert_id_id"), "alert_acts", ["alert_id", "id"])
    op.execute(
        "INSERT INTO alert_acts (alert_id, act, by, until, outcome, note, at) "
        "SELECT subject_id, substr(what, 7), by, until, outcome, note, at FROM activity "
        "WHERE what LIKE 'alert.%' AND what != 'alert.opened' "
        "AND subject_id IN (SELECT id FROM alerts) ORDER BY id"
    )
    op.drop_table("activity")
