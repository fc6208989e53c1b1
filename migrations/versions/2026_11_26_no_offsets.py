"""References without `offsets`, which nothing has ever read: the site has its own."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_26_no_offsets"
down_revision = "2026_11_26_reasons"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("site_references") as batch:
        batch.drop_column("offsets")


def downgrade() -> None:
    with op.batch_alter_table("site_references") as batch:
        batch.add_column(sa.Column("offsets", sa.JSON(), nullable=True))
