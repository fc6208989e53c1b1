"""What a person said last of a camera's pose: estimates of before that count no more."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_23_answers"
down_revision = "2026_11_23_activity"
branch_labels = None
depends_on = None

_OF_ALERTS = (
    "FROM alerts WHERE alerts.camera_id = site_references.camera_id "
    "AND kind IN ('drift', 'clock', 'out_of_range') "
    "AND outcome IN ('put_back', 'false_alarm') AND resolved_at > site_references.created_at "
    "ORDER BY resolved_at DESC LIMIT 1"
)


def upgrade() -> None:
    with op.batch_alter_table("site_references") as batch:
        batch.add_column(sa.Column("answer", sa.String(), nullable=True))
        batch.add_column(sa.Column("answered_by", sa.String(), nullable=True))
        batch.add_column(sa.Column("answered_at", sa.DateTime(), nullable=True))
    for column, source in (
        ("answer", "outcome"),
        ("answered_by", "resolved_by"),
        ("answered_at", "resolved_at"),
    ):
        op.execute(f"UPDATE site_references SET {column} = (SELECT {source} {_OF_ALERTS})")


def downgrade() -> None:
    with op.batch_alter_table("site_references") as batch:
        batch.drop_column("answered_at")
        batch.drop_column("answered_by")
        batch.drop_column("answer")
