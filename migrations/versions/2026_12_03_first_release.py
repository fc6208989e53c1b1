"""The tables of the first release."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy import JSON, Boolean, Column, DateTime, Double, Index, LargeBinary, String

revision = "2026_12_03_first_release"
down_revision = None
branch_labels = None
depends_on = None

# Declared here and not taken from the application, whose tables change later.
TABLES = sa.MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
        "pk": "pk_%(table_name)s",
    }
)
# SQLite's integers have as many bytes as they need, PostgreSQL's as they are said to.
NUMBER = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
ALERT_KINDS = "drift no_data clock lens unsure stale tracker picture many_moved many_silent"
OUTCOMES = "put_back accepted fixed relearned false_alarm cleared camera_removed"
ACTIVITY = (
    "camera.registered camera.changed camera.described camera.removed pose.confirmed pose.accepted "
    "pose.put_back pose.fixed pose.false_alarm pose.undone reference.reset reference.learned "
    "source.used source.removed alert.opened alert.grew alert.escalated alert.mailed "
    "alert.acknowledged alert.given_back alert.silenced alert.silence_ended alert.resolved "
    "alert.reopened maintenance.planned maintenance.changed maintenance.ended "
    "maintenance.withdrawn maintenance.over training.requested training.succeeded training.failed "
    "training.cancelled snapshot.kept snapshot.removed plan.kept plan.removed zones.drawn "
    "webhook.added webhook.changed webhook.secret_changed webhook.removed webhook.tested "
    "webhook.replayed token.added token.revoked session.began session.ended login.refused "
    "settings.changed handover.given handover.taken"
)


def table(name: str, *parts: Any, **options: Any) -> None:
    """Declare a table."""
    sa.Table(name, TABLES, *parts, **options)


def key(name: str, kind: Any, *target: sa.ForeignKey) -> Column[Any]:
    """A column of the primary key."""
    return Column(name, kind, *target, primary_key=True)


def needed(kind: Any, *names: str) -> list[Column[Any]]:
    """Columns that every row has a value in."""
    return [Column(name, kind, nullable=False) for name in names]


def optional(kind: Any, *names: str) -> list[Column[Any]]:
    """Columns that may be empty."""
    return [Column(name, kind) for name in names]


def of(target: str, gone: str = "CASCADE") -> sa.ForeignKey:
    """A reference to a row elsewhere, and what becomes of this one when that is deleted."""
    return sa.ForeignKey(target, ondelete=gone)


def camera() -> Column[Any]:
    """The camera that a row is of, and goes with."""
    return Column("camera_id", String(64), of("cameras.id"), nullable=False)


def prior_pose() -> Column[Any]:
    """The prior pose that a row is about."""
    return Column("prior_pose_id", NUMBER, of("prior_poses.id"), nullable=False, index=True)


def one_of(column: str, words: str) -> sa.CheckConstraint:
    """The constraint that a column has one of some words, or nothing."""
    listed = ", ".join(f"'{word}'" for word in words.split())
    return sa.CheckConstraint(f"{column} IN ({listed})", name=column)


def unique_where(name: str, condition: str, *columns: str) -> Index:
    """A unique index of some rows alone."""
    where = sa.text(condition)
    return Index(name, *columns, unique=True, sqlite_where=where, postgresql_where=where)


table(
    "cameras",
    key("id", String(64)),
    *needed(String, "name"),
    *optional(String, "site"),
    *needed(JSON, "tags"),
    *needed(NUMBER, "width", "height"),
    *needed(Double, "fx", "fy", "cx", "cy"),
    *needed(JSON, "distortion"),
    *needed(String, "projection"),
    one_of("projection", "perspective fisheye"),
    *optional(Double, "frame_rate_hz"),
    *needed(Double, "walking_speed_mean_mps", "walking_speed_sd_mps"),
    *needed(NUMBER, "reference_tracks", "version"),
    *optional(DateTime, "estimate_due_at"),
    *optional(NUMBER, "read_track_pk"),
    *optional(DateTime, "checked_at"),
    *needed(Boolean, "full_estimate_asked"),
    *needed(NUMBER, "estimate_tries"),
    *optional(String, "estimate_error"),
    *optional(DateTime, "estimate_failing_since", "estimate_after"),
    *needed(JSON, "missing_parts"),
    *optional(String, "snapshot_url"),
    *optional(DateTime, "snapshot_due_at"),
    *optional(String, "snapshot_error"),
    *needed(DateTime, "created_at", "updated_at"),
    *optional(String, "snapshot_credentials"),
    *needed(Boolean, "snapshot_digest"),
    *optional(JSON, "image_sizes"),
)
table(
    "prior_poses",
    key("id", NUMBER),
    camera(),
    *needed(Double, "height_m", "tilt_rad", "roll_rad", "heading_rad", "x_m", "y_m"),
    *needed(String, "origin"),
    *optional(String, "trusted_by"),
    *needed(JSON, "hints", "given"),
    *optional(JSON, "covariance"),
    *needed(DateTime, "created_at"),
    one_of("origin", "registered changed accepted assumed confirmed"),
    Index(None, "camera_id", "id"),
    sqlite_autoincrement=True,
)
table(
    "proposed_poses",
    key("prior_pose_id", NUMBER, of("prior_poses.id")),
    *needed(Double, "height_m", "tilt_rad", "roll_rad"),
    *needed(JSON, "covariance", "identifiable"),
    *needed(NUMBER, "tracks", "walking_groups"),
    *needed(DateTime, "created_at"),
)
table(
    "snapshots",
    key("camera_id", String(64), of("cameras.id")),
    *needed(LargeBinary, "jpeg"),
    *needed(String(64), "sha256"),
    *needed(NUMBER, "width", "height"),
    *needed(DateTime, "taken_at", "stored_at"),
    *optional(DateTime, "compared_at"),
)
table(
    "plans",
    key("camera_id", String(64), of("cameras.id")),
    *needed(LargeBinary, "jpeg"),
    *needed(String(64), "sha256"),
    *needed(NUMBER, "width", "height"),
    *needed(Double, "metres_per_pixel", "north_rad"),
    *needed(DateTime, "stored_at"),
)
table(
    "picture_references",
    key("id", NUMBER),
    camera(),
    prior_pose(),
    *needed(LargeBinary, "features"),
    Index(None, "camera_id", "id"),
)
table(
    "pictures",
    key("camera_id", String(64), of("cameras.id")),
    prior_pose(),
    *needed(DateTime, "taken_at", "stored_at"),
    *needed(String(64), "digest"),
    *needed(DateTime, "same_since"),
    *optional(JSON, "turn", "covariance"),
    *optional(Double, "zoom", "zoom_sd"),
    *needed(Boolean, "shifted"),
    *optional(Boolean, "has_moved"),
    *optional(DateTime, "other_at", "stood_at"),
    *needed(JSON, "agreement"),
    *optional(LargeBinary, "unmatched", "stood_jpeg"),
    *optional(NUMBER, "inliers"),
    *needed(NUMBER, "compared"),
    *needed(JSON, "earlier"),
)
table(
    "zones",
    key("camera_id", String(64), of("cameras.id")),
    prior_pose(),
    *needed(JSON, "zones"),
    *optional(String, "form"),
    *optional(JSON, "document"),
    *needed(JSON, "intrinsics", "pose"),
    *optional(JSON, "covariance"),
    *needed(NUMBER, "version"),
    *needed(DateTime, "drawn_at", "updated_at"),
)
table(
    "tracks",
    key("id", NUMBER),
    camera(),
    *needed(String, "source", "track_id"),
    *needed(Double, "started_s", "ended_s"),
    *needed(LargeBinary, "points"),
    *optional(LargeBinary, "boxes", "heads"),
    *needed(DateTime, "received_at"),
    *optional(NUMBER, "first_px"),
    sa.UniqueConstraint("camera_id", "source", "track_id", "started_s"),
    Index(None, "camera_id", "ended_s", "source"),
    Index(None, "camera_id", "id"),
    Index(None, "camera_id", "received_at", "ended_s", "source"),
)
table(
    "track_sources",
    key("camera_id", String(64), of("cameras.id")),
    key("name", String(200)),
    *needed(NUMBER, "tracks"),
    *needed(DateTime, "first_seen_at", "last_seen_at"),
    *optional(DateTime, "told_at"),
    *optional(String(16), "token_id"),
)
table(
    "site_references",
    key("id", NUMBER),
    camera(),
    prior_pose(),
    *needed(String, "origin"),
    *optional(String, "source", "requested_by"),
    *optional(Double, "from_s", "to_s"),
    *needed(NUMBER, "wanted", "tracks", "pieces", "hours"),
    *optional(LargeBinary, "data"),
    *optional(Double, "walking_speed_mps"),
    *needed(JSON, "doubts"),
    *optional(Double, "window_from_s", "changed_after_s", "changed_s"),
    *optional(String, "answer", "answered_by"),
    *optional(DateTime, "answered_at"),
    *needed(DateTime, "created_at"),
    *optional(DateTime, "ready_at"),
    one_of("origin", "assumed confirmed registered changed accepted reset put_back source"),
    one_of("answer", "put_back fixed false_alarm"),
    Index(None, "camera_id", "id"),
    sqlite_autoincrement=True,
)
table(
    "flow_maps",
    key("reference_id", NUMBER, of("site_references.id")),
    *optional(LargeBinary, "data", "chart"),
    *needed(NUMBER, "tracks"),
    *needed(Double, "weight", "to_s"),
    *needed(DateTime, "learned_at"),
)
table(
    "anchors",
    key("reference_id", NUMBER, of("site_references.id")),
    *needed(LargeBinary, "flow", "chart"),
    *needed(Double, "to_s"),
    *needed(DateTime, "learned_at"),
    *optional(LargeBinary, "creep"),
    *optional(Double, "logged_to_s"),
)
table(
    "last_poses",
    key("reference_id", NUMBER, of("site_references.id")),
    *needed(LargeBinary, "basis", "data"),
)
table(
    "monitor_states",
    key("camera_id", String(64), of("cameras.id")),
    *needed(LargeBinary, "basis"),
    *needed(Double, "tracks_a_year"),
    *needed(LargeBinary, "context", "scored", "newer"),
)
table(
    "trainings",
    key("id", String(32)),
    camera(),
    prior_pose(),
    *needed(String, "recipe"),
    *optional(JSON, "around"),
    *needed(NUMBER, "seed"),
    *needed(String, "state"),
    *needed(NUMBER, "attempt"),
    *needed(Boolean, "cancel_requested"),
    *needed(NUMBER, "step", "steps"),
    *optional(Double, "loss", "eta_s"),
    *optional(String, "error"),
    *optional(JSON, "metrics"),
    *needed(DateTime, "queued_at"),
    *optional(DateTime, "started_at", "finished_at"),
    one_of("state", "queued running succeeded failed cancelled"),
    Index(None, "camera_id", "queued_at"),
    Index(None, "state"),
)
table(
    "models",
    key("id", String(32)),
    camera(),
    prior_pose(),
    Column("training_id", String(32), of("trainings.id"), nullable=False, unique=True),
    *needed(String(64), "weights_sha256"),
    *needed(JSON, "config"),
    *needed(NUMBER, "seed"),
    *needed(Double, "step_s"),
    *needed(JSON, "metrics"),
    *needed(DateTime, "created_at"),
    Index(None, "camera_id", "created_at"),
)
table(
    "weights",
    key("sha256", String(64)),
    *needed(LargeBinary, "data"),
    *needed(DateTime, "stored_at"),
)
table(
    "predictions",
    key("model_id", String(32), of("models.id")),
    Column("track_pk", NUMBER, of("tracks.id"), primary_key=True, index=True),
    *needed(NUMBER, "windows"),
    *optional(Double, "height_m", "qw", "qx", "qy", "qz"),
)
table(
    "estimates",
    key("id", NUMBER),
    camera(),
    Column("model_id", String(32), of("models.id", "SET NULL"), index=True),
    prior_pose(),
    Column("reference_id", NUMBER, of("site_references.id"), index=True),
    *needed(String, "state"),
    *needed(JSON, "reasons", "told"),
    *needed(Double, "height_m", "tilt_rad", "roll_rad", "heading_rad"),
    *needed(Double, "height_sd_m", "tilt_sd_rad", "roll_sd_rad"),
    *optional(Double, "heading_sd_rad"),
    *needed(JSON, "covariance"),
    *needed(Double, "drift_height_m", "drift_tilt_rad", "drift_roll_rad"),
    *needed(Double, "drift_heading_rad", "drift_angle_rad", "moved"),
    *needed(JSON, "moved_parameters", "alternatives", "detectable"),
    *needed(Boolean, "suspected"),
    *needed(NUMBER, "drift_streak"),
    *needed(JSON, "drifted"),
    *optional(DateTime, "drift_after", "drift_since"),
    *needed(JSON, "raw"),
    *needed(NUMBER, "tracks"),
    *needed(Double, "from_s", "to_s"),
    *needed(NUMBER, "newest_track_pk"),
    *needed(DateTime, "created_at"),
    one_of("state", "learning ok unsure suspected drifting"),
    Index(None, "camera_id", "id"),
)
table(
    "alerts",
    key("id", String(32)),
    Column("camera_id", String(64), of("cameras.id")),
    *optional(JSON, "camera_ids"),
    Column("group_id", String(32), of("alerts.id", "SET NULL"), index=True),
    *optional(String, "track_source"),
    *needed(String, "kind", "state", "source"),
    *needed(Boolean, "told"),
    *needed(String, "severity"),
    *needed(JSON, "reasons", "drift"),
    *optional(JSON, "evidence"),
    *needed(DateTime, "opened_at"),
    *optional(DateTime, "changed_after", "changed_at"),
    *needed(DateTime, "updated_at"),
    *optional(String, "acknowledged_by"),
    *optional(DateTime, "acknowledged_at", "escalated_at", "silenced_until"),
    *optional(String, "silence_reason", "silenced_by"),
    *optional(DateTime, "resolved_at"),
    *optional(String, "resolved_by", "outcome", "note"),
    *needed(String(16), "poster_id"),
    one_of("kind", ALERT_KINDS),
    one_of("state", "firing resolved"),
    one_of("source", "estimate reference rhythm upkeep group tracks picture"),
    one_of("severity", "warning critical"),
    one_of("outcome", OUTCOMES),
    unique_where("uq_alerts_firing", "state = 'firing'", "camera_id", "kind"),
    unique_where(
        "uq_alerts_firing_group",
        "state = 'firing' AND camera_id IS NULL",
        "track_source",
        "poster_id",
        "kind",
    ),
    Index(None, "opened_at"),
    Index(None, "camera_id", "opened_at"),
)
table(
    "maintenance_windows",
    key("id", String(32)),
    camera(),
    *needed(DateTime, "from_at", "to_at"),
    *optional(DateTime, "ended_at"),
    *optional(String, "reason", "requested_by"),
    *needed(DateTime, "created_at", "updated_at"),
    Index(None, "camera_id", "to_at"),
)
table(
    "camera_rhythms",
    key("camera_id", String(64), of("cameras.id")),
    *optional(JSON, "profile"),
    *optional(Double, "usual_gap_s", "delay_s"),
    *needed(JSON, "counts"),
    *needed(DateTime, "learned_at"),
)
table(
    "webhooks",
    key("id", String(32)),
    *needed(String, "name", "url", "format"),
    *optional(JSON, "kinds"),
    *needed(Boolean, "enabled"),
    *needed(JSON, "disabled_reasons"),
    *optional(String, "secret", "old_secret"),
    *optional(DateTime, "old_secret_until", "job_queued_at", "held_until", "failing_since"),
    *optional(String, "last_error"),
    *optional(DateTime, "delivered_at", "refreshed_at"),
    *needed(DateTime, "created_at", "updated_at"),
    one_of("format", "webhook alertmanager"),
)
table(
    "deliveries",
    key("number", NUMBER),
    Column("id", String(32), nullable=False, unique=True),
    Column("webhook_id", String(32), of("webhooks.id"), nullable=False),
    *optional(String(32), "alert_id"),
    *needed(String, "type"),
    *needed(JSON, "payload"),
    *needed(String, "state"),
    *needed(NUMBER, "attempts", "tries"),
    *optional(DateTime, "next_attempt_at"),
    *needed(DateTime, "queued_at"),
    *optional(NUMBER, "status_code"),
    *optional(String, "error"),
    *needed(DateTime, "created_at"),
    *optional(DateTime, "finished_at"),
    one_of(
        "type",
        "alert.opened alert.updated alert.escalated alert.acknowledged alert.silenced "
        "alert.resolved report.weekly test",
    ),
    one_of("state", "pending delivered failed"),
    Index(None, "webhook_id", "state", "number"),
    Index(None, "state", "next_attempt_at"),
    sqlite_autoincrement=True,
)
table(
    "delivery_attempts",
    key("id", NUMBER),
    Column("delivery_number", NUMBER, of("deliveries.number"), nullable=False, index=True),
    *needed(DateTime, "started_at"),
    *needed(Double, "duration_s"),
    *optional(NUMBER, "status_code"),
    *optional(String, "error"),
)
table(
    "events",
    key("id", NUMBER),
    *needed(String, "type"),
    *needed(JSON, "payload"),
    *needed(DateTime, "created_at"),
    one_of("type", "pose alert training"),
    sqlite_autoincrement=True,
)
table(
    "activity",
    key("id", NUMBER),
    *needed(DateTime, "at"),
    *needed(String, "what"),
    *optional(String, "by", "via", "address"),
    *optional(String(64), "camera_id", "subject_id"),
    *optional(String, "kind"),
    *optional(DateTime, "until"),
    *optional(String, "outcome", "note"),
    *needed(JSON, "details"),
    one_of("what", ACTIVITY),
    one_of("kind", ALERT_KINDS),
    one_of("outcome", OUTCOMES),
    Index(None, "camera_id", "id"),
    Index(None, "subject_id", "id"),
    Index(None, "what", "id"),
    Index(None, "at"),
    sqlite_autoincrement=True,
)
table(
    "access_tokens",
    key("id", String(16)),
    *needed(String, "name"),
    *needed(String(64), "secret_sha256"),
    *needed(JSON, "scopes"),
    *optional(JSON, "cameras", "sources"),
    *needed(DateTime, "created_at"),
    *optional(String, "created_by"),
    *optional(DateTime, "expires_at", "used_at", "revoked_at"),
)
table(
    "access_sessions",
    key("id_sha256", String(64)),
    Column("token_id", String(16), of("access_tokens.id"), nullable=False, index=True),
    *needed(DateTime, "created_at"),
    Column("expires_at", DateTime, nullable=False, index=True),
)
table(
    "workers",
    key("name", String),
    *needed(NUMBER, "pid"),
    *needed(DateTime, "started_at", "heartbeat_at"),
    *needed(NUMBER, "beats", "starts"),
    *needed(Boolean, "lost"),
    *optional(String, "trouble"),
)
table(
    "reports",
    key("id", String(32)),
    *needed(DateTime, "due_at", "made_at"),
    *needed(String, "subject", "text"),
    *optional(DateTime, "mailed_at"),
    *optional(String, "error"),
)
table(
    "bridges",
    key("name", String(63)),
    *optional(String(16), "token_id"),
    *needed(DateTime, "started_at", "heartbeat_at"),
    *needed(NUMBER, "starts"),
    *needed(JSON, "recent_starts"),
    *needed(Boolean, "stopped"),
    *needed(JSON, "report"),
    *optional(String, "trouble"),
)
table("store_probes", key("id", NUMBER), *needed(DateTime, "written_at"))
table(
    "estimation_run_hours",
    key("id", NUMBER),
    *needed(String, "kind"),
    one_of("kind", "monitor full"),
    *needed(DateTime, "hour_at"),
    *needed(NUMBER, "runs"),
    *needed(Double, "cpu_s"),
    Index(None, "kind", "id"),
)

# Entries of the log are never changed, and for 30 days not deleted.
SQLITE_TRIGGERS = (
    "CREATE TRIGGER activity_unchanged BEFORE UPDATE ON activity "
    "BEGIN SELECT RAISE(ABORT, 'activity: entries are never changed'); END",
    "CREATE TRIGGER activity_kept BEFORE DELETE ON activity "
    "WHEN OLD.at > strftime('%Y-%m-%d %H:%M:%f', 'now', '-30 days') "
    "BEGIN SELECT RAISE(ABORT, 'activity: entries of the last 30 days are kept'); END",
)
POSTGRESQL_TRIGGERS = (
    "CREATE FUNCTION activity_unchanged() RETURNS trigger LANGUAGE plpgsql AS $$\n"
    "BEGIN RAISE EXCEPTION 'activity: entries are never changed' "
    "USING ERRCODE = 'check_violation'; END\n$$",
    "CREATE TRIGGER activity_unchanged BEFORE UPDATE ON activity "
    "FOR EACH ROW EXECUTE FUNCTION activity_unchanged()",
    "CREATE FUNCTION activity_kept() RETURNS trigger LANGUAGE plpgsql AS $$\n"
    "BEGIN RAISE EXCEPTION 'activity: entries of the last 30 days are kept' "
    "USING ERRCODE = 'check_violation'; END\n$$",
    "CREATE TRIGGER activity_kept BEFORE DELETE ON activity "
    "FOR EACH ROW WHEN (OLD.at > (now() AT TIME ZONE 'UTC') - interval '30 days') "
    "EXECUTE FUNCTION activity_kept()",
)


def upgrade() -> None:
    connection = op.get_bind()
    TABLES.create_all(connection, checkfirst=False)
    on_sqlite = connection.dialect.name == "sqlite"
    for statement in SQLITE_TRIGGERS if on_sqlite else POSTGRESQL_TRIGGERS:
        connection.exec_driver_sql(statement)


def downgrade() -> None:
    connection = op.get_bind()
    TABLES.drop_all(connection, checkfirst=False)
    if connection.dialect.name == "postgresql":
        connection.exec_driver_sql("DROP FUNCTION activity_unchanged, activity_kept")
