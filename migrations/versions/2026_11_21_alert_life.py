"""Acts and silences of alerts, groups of them, maintenance windows, rhythms of cameras."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_21_alert_life"
down_revision = "2026_11_21_webhooks"
branch_labels = None
depends_on = None


def upgrade() -> None:
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
    op.create_table(
        "maintenance_windows",
        sa.Column("id", sa.String(length=32), nullable=False),
        sa.Column("camera_id", sa.String(length=64), nullable=False),
        sa.Column("from_at", sa.DateTime(), nullable=False),
        sa.Column("to_at", sa.DateTime(), nullable=False),
        sa.Column("reason", sa.String(), nullable=True),
        sa.Column("requested_by", sa.String(), nullable=True),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("updated_at", sa.DateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["camera_id"],
            ["cameras.id"],
            name=op.f("fk_maintenance_windows_camera_id_cameras"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_maintenance_windows")),
    )
    op.create_index(
        op.f("ix_maintenance_windows_camera_id_to_at"),
        "maintenance_windows",
        ["camera_id", "to_at"],
    )
    op.create_table(
        "camera_rhythms",
        sa.Column("camera_id", sa.String(length=64), nullable=False),
        sa.Column("profile", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("counts", sa.JSON(), nullable=False),
        sa.Column("learned_at", sa.DateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["camera_id"],
            ["cameras.id"],
            name=op.f("fk_camera_rhythms_camera_id_cameras"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("camera_id", name=op.f("pk_camera_rhythms")),
    )
    op.create_index(
        op.f("ix_tracks_camera_id_received_at_ended_s"),
        "tracks",
        ["camera_id", "received_at", "ended_s"],
    )
    with op.batch_alter_table("alerts") as batch:
        batch.add_column(sa.Column("camera_ids", sa.JSON(none_as_null=True), nullable=True))
        batch.add_column(sa.Column("group_id", sa.String(length=32), nullable=True))
        batch.add_column(sa.Column("track_source", sa.String(), nullable=True))
        batch.add_column(sa.Column("silenced_by", sa.String(), nullable=True))
        # All alerts so far were told of.
        batch.add_column(sa.Column("told", sa.Boolean(), server_default=sa.true()))
        batch.alter_column("camera_id", existing_type=sa.String(length=64), nullable=True)
    with op.batch_alter_table("alerts") as batch:
        batch.alter_column("told", existing_type=sa.Boolean(), nullable=False, server_default=None)
        batch.create_foreign_key(
            op.f("fk_alerts_group_id_alerts"), "alerts", ["group_id"], ["id"], ondelete="SET NULL"
        )
        batch.create_index(op.f("ix_alerts_group_id"), ["group_id"])
        batch.create_index(op.f("ix_alerts_camera_id_opened_at"), ["camera_id", "opened_at"])
        batch.create_index(
            "uq_alerts_firing_group",
            ["track_source", "kind"],
            unique=True,
            sqlite_where=sa.text("state = 'firing' AND camera_id IS NULL"),
            postgresql_where=sa.text("state = 'firing' AND camera_id IS NULL"),
        )


def downgrade() -> None:
    op.execute("DELETE FROM alerts WHERE camera_id IS NULL")
    with op.batch_alter_table("alerts") as batch:
        batch.drop_index("uq_alerts_firing_group")
        batch.drop_index(op.f("ix_alerts_camera_id_opened_at"))
        batch.drop_index(op.f("ix_alerts_group_id"))
        batch.drop_constraint(op.f("fk_alerts_group_id_alerts"), type_="foreignkey")
        batch.alter_column("camera_id", existing_type=sa.String(length=64), nullable=False)
        batch.drop_column("told")
        batch.drop_column("silenced_by")
        batch.drop_column("track_source")
        batch.drop_column("group_id")
        batch.drop_column("camera_ids")
    op.drop_index(op.f("ix_tracks_camera_id_received_at_ended_s"), table_name="tracks")
    op.drop_table("camera_rhythms")
    op.drop_index(op.f("ix_maintenance_windows_camera_id_to_at"), table_name="maintenance_windows")
    op.drop_table("maintenance_windows")
    op.drop_index(op.f("ix_alert_acts_alert_id_id"), table_name="alert_acts")
    op.drop_table("alert_acts")
