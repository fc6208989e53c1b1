"""The closed vocabularies: states, kinds, outcomes, severities, activity; each is defined here.

Their values are what HTTP, webhooks and the store say. The store refuses any other word by a CHECK
constraint, so a new one needs a migration.
"""

from enum import StrEnum


class PoseState(StrEnum):
    """The state of a camera.

    It is unconnected until the first track for it is stored or an image was compared, and
    uncalibrated until a person has confirmed a prior pose.
    """

    UNCONNECTED = "unconnected"
    UNCALIBRATED = "uncalibrated"
    LEARNING = "learning"
    OK = "ok"
    UNSURE = "unsure"
    SUSPECTED = "suspected"
    DRIFTING = "drifting"
    NO_DATA = "no_data"


class RunKind(StrEnum):
    """The kind of an estimation run.

    A monitor run updates the drift chart and slow drift alone. All others are full: they estimate
    the pose, learn a reference or renew the flow map, or find that nothing is new.
    """

    MONITOR = "monitor"
    FULL = "full"


class Cause(StrEnum):
    """Since what a camera waits for people to tell how it stands."""

    REFERENCE = "reference"
    MAINTENANCE = "maintenance"
    PUT_BACK = "put_back"
    FIXED = "fixed"
    FALSE_ALARM = "false_alarm"


class ZoneOn(StrEnum):
    """What a zone lies on: the ground, or what else there is in the scene."""

    GROUND = "ground"
    SCENE = "scene"


class ReferenceState(StrEnum):
    """The state of a reference."""

    LEARNING = "learning"
    READY = "ready"


class Origin(StrEnum):
    """The origin of a prior pose or a reference; prior poses use the first five.

    An assumed pose is a default, except for the parameters that were measured. A confirmed pose
    was estimated from tracks and confirmed by an operator.
    """

    ASSUMED = "assumed"
    CONFIRMED = "confirmed"
    REGISTERED = "registered"
    CHANGED = "changed"
    ACCEPTED = "accepted"
    RESET = "reset"
    PUT_BACK = "put_back"
    SOURCE = "source"


class AlertKind(StrEnum):
    """The kind of an alert; the last two are of a group."""

    DRIFT = "drift"
    NO_DATA = "no_data"
    CLOCK = "clock"
    LENS = "lens"
    UNSURE = "unsure"
    STALE = "stale"
    TRACKER = "tracker"
    PICTURE = "picture"
    MANY_MOVED = "many_moved"
    MANY_SILENT = "many_silent"


class AlertState(StrEnum):
    """The state of an alert."""

    FIRING = "firing"
    RESOLVED = "resolved"


class AlertSource(StrEnum):
    """The part of the service that opened an alert, and ends it."""

    ESTIMATE = "estimate"
    REFERENCE = "reference"
    RHYTHM = "rhythm"
    UPKEEP = "upkeep"
    GROUP = "group"
    TRACKS = "tracks"
    PICTURE = "picture"


class Severity(StrEnum):
    """The severity of an alert, the least first."""

    WARNING = "warning"
    CRITICAL = "critical"


class Answer(StrEnum):
    """An operator's answer to an alert; the kind of the alert determines the possible ones."""

    PUT_BACK = "put_back"
    ACCEPTED = "accepted"
    FIXED = "fixed"
    FALSE_ALARM = "false_alarm"


class Action(StrEnum):
    """An action on many items at once: the first three on alerts, the others on cameras."""

    ACKNOWLEDGE = "acknowledge"
    SILENCE = "silence"
    RESOLVE = "resolve"
    MAINTENANCE = "maintenance"
    PUT_BACK = "put_back"
    ACCEPT = "accept"
    RESET = "reset"
    UNDO = "undo"
    TAG = "tag"


class Outcome(StrEnum):
    """The outcome of an alert: an operator's answer, or the event that closed the alert."""

    PUT_BACK = Answer.PUT_BACK
    ACCEPTED = Answer.ACCEPTED
    FIXED = Answer.FIXED
    RELEARNED = "relearned"
    FALSE_ALARM = Answer.FALSE_ALARM
    CLEARED = "cleared"
    CAMERA_REMOVED = "camera_removed"


class AlertActivity(StrEnum):
    """An action on an alert."""

    OPENED = "opened"
    GREW = "grew"
    ESCALATED = "escalated"
    MAILED = "mailed"
    ACKNOWLEDGED = "acknowledged"
    GIVEN_BACK = "given_back"
    SILENCED = "silenced"
    SILENCE_ENDED = "silence_ended"
    RESOLVED = "resolved"
    REOPENED = "reopened"


class WindowState(StrEnum):
    """The state of a maintenance window."""

    PLANNED = "planned"
    UNDER_WAY = "under_way"
    OVER = "over"


class TrainingState(StrEnum):
    """The state of a training."""

    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"


class EventType(StrEnum):
    """The types of `GET /events`."""

    POSE = "pose"
    ALERT = "alert"
    TRAINING = "training"


class WebhookFormat(StrEnum):
    """The format of an endpoint: signed messages, or an Alertmanager's."""

    WEBHOOK = "webhook"
    ALERTMANAGER = "alertmanager"


class MessageType(StrEnum):
    """The type of a delivery's message."""

    ALERT_OPENED = "alert.opened"
    ALERT_UPDATED = "alert.updated"
    ALERT_ESCALATED = "alert.escalated"
    ALERT_ACKNOWLEDGED = "alert.acknowledged"
    ALERT_SILENCED = "alert.silenced"
    ALERT_RESOLVED = "alert.resolved"
    REPORT = "report.weekly"
    TEST = "test"


class DeliveryState(StrEnum):
    """The state of a delivery."""

    PENDING = "pending"
    DELIVERED = "delivered"
    FAILED = "failed"


class TokenScope(StrEnum):
    """The scopes of tokens."""

    INGEST = "ingest"
    READ = "read"
    OPERATE = "operate"
    ADMIN = "admin"


class TokenState(StrEnum):
    """The state of a token."""

    VALID = "valid"
    EXPIRED = "expired"
    REVOKED = "revoked"


class Health(StrEnum):
    """The answer of `/healthz`."""

    OK = "ok"


class Readiness(StrEnum):
    """The answers of `/readyz`."""

    READY = "ready"
    NOT_READY = "not_ready"


class Activity(StrEnum):
    """Entries of the log: a subject and a verb."""

    CAMERA_REGISTERED = "camera.registered"
    CAMERA_CHANGED = "camera.changed"
    CAMERA_DESCRIBED = "camera.described"
    CAMERA_REMOVED = "camera.removed"
    POSE_CONFIRMED = "pose.confirmed"
    POSE_ACCEPTED = "pose.accepted"
    POSE_PUT_BACK = "pose.put_back"
    POSE_FIXED = "pose.fixed"
    POSE_FALSE_ALARM = "pose.false_alarm"
    POSE_UNDONE = "pose.undone"
    REFERENCE_RESET = "reference.reset"
    REFERENCE_LEARNED = "reference.learned"
    SOURCE_USED = "source.used"
    SOURCE_REMOVED = "source.removed"
    ALERT_OPENED = "alert.opened"
    ALERT_GREW = "alert.grew"
    ALERT_ESCALATED = "alert.escalated"
    ALERT_MAILED = "alert.mailed"
    ALERT_ACKNOWLEDGED = "alert.acknowledged"
    ALERT_GIVEN_BACK = "alert.given_back"
    ALERT_SILENCED = "alert.silenced"
    ALERT_SILENCE_ENDED = "alert.silence_ended"
    ALERT_RESOLVED = "alert.resolved"
    ALERT_REOPENED = "alert.reopened"
    MAINTENANCE_PLANNED = "maintenance.planned"
    MAINTENANCE_CHANGED = "maintenance.changed"
    MAINTENANCE_ENDED = "maintenance.ended"
    MAINTENANCE_WITHDRAWN = "maintenance.withdrawn"
    MAINTENANCE_OVER = "maintenance.over"
    TRAINING_REQUESTED = "training.requested"
    TRAINING_SUCCEEDED = "training.succeeded"
    TRAINING_FAILED = "training.failed"
    TRAINING_CANCELLED = "training.cancelled"
    SNAPSHOT_KEPT = "snapshot.kept"
    SNAPSHOT_REMOVED = "snapshot.removed"
    PLAN_KEPT = "plan.kept"
    PLAN_REMOVED = "plan.removed"
    ZONES_DRAWN = "zones.drawn"
    WEBHOOK_ADDED = "webhook.added"
    WEBHOOK_CHANGED = "webhook.changed"
    WEBHOOK_SECRET_CHANGED = "webhook.secret_changed"
    WEBHOOK_REMOVED = "webhook.removed"
    WEBHOOK_TESTED = "webhook.tested"
    WEBHOOK_REPLAYED = "webhook.replayed"
    TOKEN_ADDED = "token.added"
    TOKEN_REVOKED = "token.revoked"
    SESSION_BEGAN = "session.began"
    SESSION_ENDED = "session.ended"
    LOGIN_REFUSED = "login.refused"
    SETTINGS_CHANGED = "settings.changed"
    HANDOVER_GIVEN = "handover.given"
    HANDOVER_TAKEN = "handover.taken"
