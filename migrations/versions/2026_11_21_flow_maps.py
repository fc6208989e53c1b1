"""Flow maps of references; estimates with a heading."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_21_flow_maps"
down_revision = "2026_11_21_references"
branch_labels = None
depends_on = None

# Estimates of before told no heading: what was served was that of their prior pose.
_PRIOR_HEADINGS = """
UPDATE estimates SET suspected = 0, drift_heading_rad = 0, heading_rad =
    (SELECT p.heading_rad FROM prior_poses p WHERE p.id = estimates.prior_pose_id)
"""


def upgrade() -> None:
    op.create_table(
        "flow_maps",
        sa.Column("reference_id", sa.Integer(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=True),
        sa.Column("tracks", sa.Integer(), nullable=False),
        sa.Column("weight", sa.Double(), nullable=False),
        sa.Column("to_s", sa.Double(), nullable=False),
        sa.Column("learned_at", sa.DateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["reference_id"],
            ["site_references.id"],
            name=op.f("fk_flow_maps_reference_id_site_references"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("reference_id", name=op.f("pk_flow_maps")),
    )
    with op.batch_alter_table("estimates") as batch:
        batch.add_column(sa.Column("heading_rad", sa.Double(), nullable=True))
        batch.add_column(sa.Column("heading_sd_rad", sa.Double(), nullable=True))
        batch.add_column(sa.Column("drift_heading_rad", sa.Double(), nullable=True))
        batch.add_column(sa.Column("suspected", sa.Boolean(), nullable=True))
    op.execute(_PRIOR_HEADINGS)
    with op.batch_alter_table("estimates") as batch:
        batch.alter_column("heading_rad", existing_type=sa.Double(), nullable=False)
        batch.alter_column("drift_heading_rad", existing_type=sa.Double(), nullable=False)
        batch.alter_column("suspected", existing_type=sa.Boolean(), nullable=False)


def downgrade() -> None:
    with op.batch_alter_table("estimates") as batch:
        batch.drop_column("suspected")
        batch.drop_column("drift_heading_rad")
        batch.drop_column("heading_sd_rad")
        batch.drop_column("heading_rad")
    op.drop_table("flow_maps")
