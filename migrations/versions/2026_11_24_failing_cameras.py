"""Cameras say whether their estimates fail, why, since when, and when one may be made again."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_failing_cameras"
down_revision = "2026_11_24_parent_indexes"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("cameras") as batch:
        batch.add_column(sa.Column("estimate_tries", sa.Integer(), server_default="0"))
        batch.add_column(sa.Column("estimate_error", sa.String(), nullable=True))
        batch.add_column(sa.Column("estimate_failing_since", sa.DateTime(), nullable=True))
        batch.add_column(sa.Column("estimate_after", sa.DateTime(), nullable=True))
        batch.add_column(sa.Column("estimate_lacks", sa.String(), nullable=True))
    with op.batch_alter_table("cameras") as batch:
        batch.alter_column("estimate_tries", nullable=False, server_default=None)


def downgrade() -> None:
    with op.batch_alter_table("cameras") as batch:
        batch.drop_column("estimate_lacks")
        batch.drop_column("estimate_after")
        batch.drop_column("estimate_failing_since")
        batch.drop_column("estimate_error")
        batch.drop_column("estimate_tries")
