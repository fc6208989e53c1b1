"""What each estimator said by itself (`estimates.raw`) in radians, as all else that is stored."""

import sqlalchemy as sa
from alembic import op

from migrations.angles import to_degrees, to_radians, turn

revision = "2026_11_26_radians_of_estimates"
down_revision = "2026_11_26_no_offsets"
branch_labels = None
depends_on = None

_ESTIMATES = sa.table("estimates", sa.column("id", sa.Integer), sa.column("raw", sa.JSON))


def upgrade() -> None:
    turn(op.get_bind(), _ESTIMATES, "raw", to_radians)


def downgrade() -> None:
    turn(op.get_bind(), _ESTIMATES, "raw", to_degrees)
