"""What failed beside an estimate, why a webhook is disabled: codes; sentences stay as said."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_27_reasons_of_lacks"
down_revision = "2026_11_26_stored_models"
branch_labels = None
depends_on = None

_COLUMNS = (
    ("cameras", "estimate_lacks", "lacks"),
    ("webhooks", "disabled_reason", "disabled_reasons"),
)
_AS_SAID = """
    CASE coalesce({old}, '') WHEN '' THEN '[]' ELSE json_array(
        json_object('code', 'as_said', 'values', json_object('text', {old}))) END
"""
_IN_WORDS = """
    (SELECT group_concat(coalesce(json_extract(value, '$.values.text'),
                                  json_extract(value, '$.code')), '; ')
     FROM json_each({new}))
"""


def upgrade() -> None:
    for table, old, new in _COLUMNS:
        op.add_column(table, sa.Column(new, sa.JSON(), nullable=False, server_default="[]"))
        op.execute(f"UPDATE {table} SET {new} = {_AS_SAID.format(old=old)}")
        with op.batch_alter_table(table) as batch:
            batch.drop_column(old)
            batch.alter_column(new, server_default=None)


def downgrade() -> None:
    for table, old, new in _COLUMNS:
        op.add_column(table, sa.Column(old, sa.String(), nullable=True))
        op.execute(f"UPDATE {table} SET {old} = {_IN_WORDS.format(new=new)}")
        with op.batch_alter_table(table) as batch:
            batch.drop_column(new)
