"""Reasons are codes and numbers; sentences of before stay readable, as they were said."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_26_reasons"
down_revision = "2026_11_26_closed_words"
branch_labels = None
depends_on = None

_AS_SAID = """
    CASE {old} WHEN '' THEN '[]' ELSE json_array(
        json_object('code', 'as_said', 'values', json_object('text', {old}))) END
"""
# What a group is told with is known of it: its page says it without the tracker's name.
_OF_GROUP = """
    json_array(json_object(
        'code', CASE kind WHEN 'no_data' THEN 'fell_silent_together' ELSE 'moved_together' END,
        'values', json_object('cameras', json_array_length(camera_ids),
                              'track_source', coalesce(track_source, ''))))
"""
# Without the words of the release that said it, a code has to do.
_IN_WORDS = """
    coalesce((SELECT group_concat(coalesce(json_extract(value, '$.values.text'),
                                           json_extract(value, '$.code')), '; ')
              FROM json_each({old})), '')
"""


def upgrade() -> None:
    _replace("estimates", "reason", "reasons", sa.JSON(), _AS_SAID)
    _replace("site_references", "doubt", "doubts", sa.JSON(), _AS_SAID)
    of_group = f"CASE WHEN source = 'group' THEN {_OF_GROUP} ELSE {_AS_SAID} END"
    _replace("alerts", "reason", "reasons", sa.JSON(), of_group)


def downgrade() -> None:
    _replace("alerts", "reasons", "reason", sa.String(), _IN_WORDS)
    _replace("site_references", "doubts", "doubt", sa.String(), _IN_WORDS)
    _replace("estimates", "reasons", "reason", sa.String(), _IN_WORDS)


def _replace(table: str, old: str, new: str, kind: sa.types.TypeEngine[object], value: str) -> None:
    """Put one column in the place of another; a table that is made anew keeps its checks."""
    op.add_column(table, sa.Column(new, kind, nullable=False, server_default="[]"))
    op.execute(f"UPDATE {table} SET {new} = {value.format(old=old)}")
    with op.batch_alter_table(table) as batch:
        batch.drop_column(old)
        batch.alter_column(new, server_default=None)
