"""Sources of tracks: a reference is of one of them."""

import sqlalchemy as sa
from alembic import op

revision = "2026_11_25_track_sources"
down_revision = "2026_11_24_worker_beats"
branch_labels = None
depends_on = None

_SOURCES = """
    INSERT INTO track_sources (camera_id, name, tracks, first_seen_at, last_seen_at, told_at)
    SELECT camera_id, substr(source, 1, 200), count(*), min(received_at), max(received_at),
           max(received_at)
    FROM tracks GROUP BY camera_id, substr(source, 1, 200)
"""
# The newest reference of a camera is of what was posted for it last, as far as that is known.
_COUNTING = """
    UPDATE site_references SET source = (
        SELECT tracks.source FROM tracks WHERE tracks.camera_id = site_references.camera_id
        ORDER BY tracks.ended_s DESC, tracks.id DESC LIMIT 1
    )
    WHERE id IN (SELECT max(id) FROM site_references GROUP BY camera_id)
"""
# Those of a source are found in them without a look at the tracks.
_INDEXES = (["camera_id", "ended_s"], ["camera_id", "received_at", "ended_s"])


def upgrade() -> None:
    op.create_table(
        "track_sources",
        sa.Column("camera_id", sa.String(length=64), nullable=False),
        sa.Column("name", sa.String(length=200), nullable=False),
        sa.Column("tracks", sa.Integer(), nullable=False),
        sa.Column("first_seen_at", sa.DateTime(), nullable=False),
        sa.Column("last_seen_at", sa.DateTime(), nullable=False),
        sa.Column("told_at", sa.DateTime(), nullable=True),
        sa.ForeignKeyConstraint(
            ["camera_id"],
            ["cameras.id"],
            name=op.f("fk_track_sources_camera_id_cameras"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("camera_id", "name", name=op.f("pk_track_sources")),
    )
    with op.batch_alter_table("site_references") as batch:
        batch.add_column(sa.Column("source", sa.String(), nullable=True))
    for columns in _INDEXES:
        _replace_index(columns, [*columns, "source"])
    op.execute(_SOURCES)
    op.execute(_COUNTING)


def downgrade() -> None:
    for columns in _INDEXES:
        _replace_index([*columns, "source"], columns)
    with op.batch_alter_table("site_references") as batch:
        batch.drop_column("source")
    op.drop_table("track_sources")


def _replace_index(old: list[str], new: list[str]) -> None:
    op.drop_index(op.f("_".join(["ix_tracks", *old])), "tracks")
    op.create_index(op.f("_".join(["ix_tracks", *new])), "tracks", new)
