"""Workers beat by a counter, which no clock can set back, and are counted as they start."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_24_worker_beats"
down_revision = "2026_11_24_tracks_by_arrival"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("workers") as batch:
        batch.add_column(sa.Column("beats", sa.Integer(), server_default="0"))
        batch.add_column(sa.Column("starts", sa.Integer(), server_default="1"))
        batch.add_column(sa.Column("lost", sa.Boolean(), server_default=sa.false()))
        batch.add_column(sa.Column("trouble", sa.String(), nullable=True))
    with op.batch_alter_table("workers") as batch:
        batch.alter_column("beats", nullable=False, server_default=None)
        batch.alter_column("starts", nullable=False, server_default=None)
        batch.alter_column("lost", nullable=False, server_default=None)


def downgrade() -> None:
    with op.batch_alter_table("workers") as batch:
        batch.drop_column("trouble")
        batch.drop_column("lost")
        batch.drop_column("starts")
        batch.drop_column("beats")
