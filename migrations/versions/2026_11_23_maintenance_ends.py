"""When maintenance really ended, beside when it was planned to."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_maintenance_ends"
down_revision = "2026_11_23_answers"
branch_labels = None
depends_on = None


def upgrade() -> None:
    with op.batch_alter_table("maintenance_windows") as batch:
        batch.add_column(sa.Column("ended_at", sa.DateTime(), nullable=True))
    # The ends of those that are over are no news any more.
    op.execute(
        "UPDATE maintenance_windows SET ended_at = to_at "
        "WHERE to_at <= strftime('%Y-%m-%d %H:%M:%f', 'now')"
    )


def downgrade() -> None:
    op.execute("UPDATE maintenance_windows SET to_at = ended_at WHERE ended_at IS NOT NULL")
    with op.batch_alter_table("maintenance_windows") as batch:
        batch.drop_column("ended_at")
