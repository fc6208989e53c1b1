"""Drift charts beside the flow maps that they go with."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_21_drift_charts"
down_revision = "2026_11_21_flow_maps"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # A map of before has none until it grows: its camera is judged by its pose alone.
    with op.batch_alter_table("flow_maps") as batch:
        batch.add_column(sa.Column("chart", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("flow_maps") as batch:
        batch.drop_column("chart")
