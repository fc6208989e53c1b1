"""Anchors: the first map and chart of each reference; the present ones of those that have grown."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_28_anchors"
down_revision = "2026_11_27_reasons_of_lacks"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "anchors",
        sa.Column("reference_id", sa.Integer(), nullable=False),
        sa.Column("flow", sa.LargeBinary(), nullable=False),
        sa.Column("chart", sa.LargeBinary(), nullable=False),
        sa.Column("to_s", sa.Double(), nullable=False),
        sa.Column("learned_at", sa.DateTime(), nullable=False),
        sa.Column("creep", sa.LargeBinary(), nullable=True),
        sa.Column("logged_to_s", sa.Double(), nullable=True),
        sa.ForeignKeyConstraint(
            ["reference_id"],
            ["site_references.id"],
            name=op.f("fk_anchors_reference_id_site_references"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("reference_id", name=op.f("pk_anchors")),
    )
    op.execute(
        "INSERT INTO anchors (reference_id, flow, chart, to_s, learned_at) "
        "SELECT reference_id, data, chart, to_s, learned_at FROM flow_maps "
        "WHERE data IS NOT NULL AND chart IS NOT NULL"
    )


def downgrade() -> None:
    op.drop_table("anchors")
