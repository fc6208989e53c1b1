"""Heads: tracks whose points carry them keep them beside their feet; none of earlier ones."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_29_heads"
down_revision = "2026_11_28_anchors"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("tracks", sa.Column("heads", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    op.drop_column("tracks", "heads")
