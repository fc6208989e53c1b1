"""Which cameras are looked at before others. Releases of before go on beside it."""

import sqlalchemy as sa
from alembic import op

revision = "2026_12_02_urgent"
down_revision = "2026_12_01_weights"
branch_labels = None
depends_on = None


def upgrade() -> None:
    urgent = sa.Column("urgent", sa.Boolean(), nullable=False, server_default=sa.false())
    op.add_column("cameras", urgent)


def downgrade() -> None:
    with op.batch_alter_table("cameras") as batch:
        batch.drop_column("urgent")
