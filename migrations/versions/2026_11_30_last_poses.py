"""Last poses: where the next estimate of a camera may begin; the first one of each has none."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_30_last_poses"
down_revision = "2026_11_29_heads"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "last_poses",
        sa.Column("reference_id", sa.Integer(), nullable=False),
        sa.Column("basis", sa.LargeBinary(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["reference_id"],
            ["site_references.id"],
            name=op.f("fk_last_poses_reference_id_site_references"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("reference_id", name=op.f("pk_last_poses")),
    )


def downgrade() -> None:
    op.drop_table("last_poses")
