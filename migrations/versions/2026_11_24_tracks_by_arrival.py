"""The oldest track that nothing has looked at is one lookup a camera."""

from alembic import op

revision = "2026_11_24_tracks_by_arrival"
down_revision = "2026_11_24_failing_cameras"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index(op.f("ix_tracks_camera_id_id"), "tracks", ["camera_id", "id"])


def downgrade() -> None:
    op.drop_index(op.f("ix_tracks_camera_id_id"), table_name="tracks")
