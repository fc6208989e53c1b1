"""A row to write when somebody asks whether the store can be written."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_store_probes"
down_revision = "2026_11_23_maintenance_ends"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "store_probes",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("written_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_store_probes")),
    )


def downgrade() -> None:
    op.drop_table("store_probes")
