"""Weights in the database, for machines that have no disk in common; a file keeps none there."""

import sqlalchemy as sa
from alembic import op

revision = "2026_12_01_weights"
down_revision = "2026_11_30_last_poses"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "weights",
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("stored_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("sha256", name=op.f("pk_weights")),
    )


def downgrade() -> None:
    op.drop_table("weights")
