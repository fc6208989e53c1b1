"""References, estimates that need no model, trainings around a pose, alerts with reasons."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_21_references"
down_revision = "2026_11_21_first"
branch_labels = None
depends_on = None

# Every camera begins to learn anew: what was stored before knew of no reference. Tracks that came
# in before its prior pose was trusted may be of another pose.
_FIRST_REFERENCES = """
INSERT INTO site_references
    (camera_id, prior_pose_id, origin, from_s, wanted, tracks, doubt, created_at)
SELECT c.id, p.id, p.origin,
       CASE WHEN p.origin = 'registered' THEN NULL ELSE
           (SELECT max(t.ended_s) FROM tracks t
            WHERE t.camera_id = c.id AND t.received_at <= p.created_at) END,
       c.reference_tracks, 0, '', p.created_at
FROM cameras c
JOIN prior_poses p ON p.id = (SELECT max(q.id) FROM prior_poses q WHERE q.camera_id = c.id)
"""


def upgrade() -> None:
    op.create_table(
        "site_references",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("camera_id", sa.String(length=64), nullable=False),
        sa.Column("prior_pose_id", sa.Integer(), nullable=False),
        sa.Column("origin", sa.String(), nullable=False),
        sa.Column("requested_by", sa.String(), nullable=True),
        sa.Column("from_s", sa.Double(), nullable=True),
        sa.Column("to_s", sa.Double(), nullable=True),
        sa.Column("wanted", sa.Integer(), nullable=False),
        sa.Column("tracks", sa.Integer(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=True),
        sa.Column("walking_speed_mps", sa.Double(), nullable=True),
        sa.Column("offsets", sa.JSON(), nullable=True),
        sa.Column("doubt", sa.String(), nullable=False),
        sa.Column("window_from_s", sa.Double(), nullable=True),
        sa.Column("changed_s", sa.Double(), nullable=True),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("ready_at", sa.DateTime(), nullable=True),
        sa.ForeignKeyConstraint(
            ["camera_id"],
            ["cameras.id"],
            name=op.f("fk_site_references_camera_id_cameras"),
            ondelete="CASCADE",
        ),
        sa.ForeignKeyConstraint(
            ["prior_pose_id"],
            ["prior_poses.id"],
            name=op.f("fk_site_references_prior_pose_id_prior_poses"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_site_references")),
    )
    op.create_index(op.f("ix_site_references_camera_id_id"), "site_references", ["camera_id", "id"])
    op.execute(_FIRST_REFERENCES)
    op.add_column("cameras", sa.Column("looked_at_pk", sa.Integer(), nullable=True))
    op.add_column("trainings", sa.Column("around", sa.JSON(), nullable=True))
    with op.batch_alter_table("alerts") as batch:
        batch.add_column(sa.Column("source", sa.String(), server_default="estimate"))
        batch.add_column(sa.Column("reason", sa.String(), server_default=""))
    with op.batch_alter_table("alerts") as batch:
        batch.alter_column("source", nullable=False, server_default=None)
        batch.alter_column("reason", nullable=False, server_default=None)
    with op.batch_alter_table("estimates") as batch:
        batch.add_column(sa.Column("reference_id", sa.Integer(), nullable=True))
        batch.add_column(sa.Column("told", sa.JSON(), server_default='["tilt", "roll", "height"]'))
        batch.add_column(sa.Column("drifted", sa.JSON(), server_default="[]"))
    with op.batch_alter_table("estimates") as batch:
        batch.alter_column("told", nullable=False, server_default=None)
        batch.alter_column("drifted", nullable=False, server_default=None)
        batch.alter_column("model_id", existing_type=sa.String(length=32), nullable=True)
        batch.drop_constraint(op.f("fk_estimates_model_id_models"), type_="foreignkey")
        batch.create_foreign_key(
            op.f("fk_estimates_model_id_models"),
            "models",
            ["model_id"],
            ["id"],
            ondelete="SET NULL",
        )
        batch.create_foreign_key(
            op.f("fk_estimates_reference_id_site_references"),
            "site_references",
            ["reference_id"],
            ["id"],
            ondelete="CASCADE",
        )


def downgrade() -> None:
    op.execute("DELETE FROM estimates WHERE model_id IS NULL")
    with op.batch_alter_table("estimates") as batch:
        batch.drop_constraint(op.f("fk_estimates_reference_id_site_references"), type_="foreignkey")
        batch.drop_constraint(op.f("fk_estimates_model_id_models"), type_="foreignkey")
        batch.create_foreign_key(
            op.f("fk_estimates_model_id_models"),
            "models",
            ["model_id"],
            ["id"],
            ondelete="CASCADE",
        )
        batch.alter_column("model_id", existing_type=sa.String(length=32), nullable=False)
        batch.drop_column("drifted")
        batch.drop_column("told")
        batch.drop_column("reference_id")
    with op.batch_alter_table("alerts") as batch:
        batch.drop_column("reason")
        batch.drop_column("source")
    with op.batch_alter_table("trainings") as batch:
        batch.drop_column("around")
    with op.batch_alter_table("cameras") as batch:
        batch.drop_column("looked_at_pk")
    op.drop_index(op.f("ix_site_references_camera_id_id"), table_name="site_references")
    op.drop_table("site_references")
