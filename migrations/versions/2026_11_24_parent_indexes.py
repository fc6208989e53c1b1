"""Indexes of references: deleting a pose, a reference or a model looked through all estimates."""

from alembic import op

revision = "2026_11_24_parent_indexes"
down_revision = "2026_11_24_access"
branch_labels = None
depends_on = None

_COLUMNS = (
    ("site_references", "prior_pose_id"),
    ("trainings", "prior_pose_id"),
    ("models", "prior_pose_id"),
    ("estimates", "prior_pose_id"),
    ("estimates", "reference_id"),
    ("estimates", "model_id"),
)


def upgrade() -> None:
    for table, column in _COLUMNS:
        op.create_index(op.f(f"ix_{table}_{column}"), table, [column])


def downgrade() -> None:
    for table, column in reversed(_COLUMNS):
        op.drop_index(op.f(f"ix_{table}_{column}"), table_name=table)
