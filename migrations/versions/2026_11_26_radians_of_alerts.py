"""The drift that an alert tells of in radians, as all else that is stored."""

import sqlalchemy as sa
from alembic import op

from migrations.angles import to_degrees, to_radians, turn

revision = "2026_11_26_radians_of_alerts"
down_revision = "2026_11_26_radians_of_estimates"
branch_labels = None
depends_on = None

_ALERTS = sa.table("alerts", sa.column("id", sa.String), sa.column("drift", sa.JSON))


def upgrade() -> None:
    turn(op.get_bind(), _ALERTS, "drift", to_radians)


def downgrade() -> None:
    turn(op.get_bind(), _ALERTS, "drift", to_degrees)
