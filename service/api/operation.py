"""`/healthz`, `/readyz`, and `/metrics` in Prometheus' words: base units, one name a thing.

There is no counter of alerts ever opened: alerts go with their camera, and a counter that falls is
a lie. `surefoot_events_total` counts by ids that are never given twice.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from itertools import product
from typing import Annotated, Any

from fastapi import APIRouter, Header, Response
from prometheus_client import Metric
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily
from prometheus_client.exposition import choose_encoder
from prometheus_client.registry import Collector
from pydantic import BaseModel

from models.geometry.pose import ANGLES
from service.api.middleware.dependencies import CallerDep, ReadDep, StateDep
from service.api.middleware.hosts import auth_on
from service.api.schemas import Out
from service.enums import AlertKind, Health, PoseState, Readiness, Severity, TrainingState
from service.operations import health as checks
from service.operations.bridges import COUNTS
from service.operations.health import Metrics, load_metrics


class HealthOut(BaseModel):
    """The process answers."""

    status: Health


class ReadyOut(Out):
    """Whether the service can do its work; some problems are named while it can."""

    status: Readiness
    store_writable: bool
    worker_alive: bool
    worker_silent_s: float | None
    queue_lag_s: float
    failing_cameras: int
    bridge_silent_s: float | None
    problems: list[str]


class MetricsCollector(Collector):
    """The metrics of a moment and what others collect, as metrics."""

    def __init__(self, metrics: Metrics, *others: Collector) -> None:
        self._metrics = metrics
        self._others = others

    def collect(self) -> Iterator[Metric]:
        """Collect the metrics of cameras, looks, alerts, webhooks and the service."""
        yield InfoMetricFamily("surefoot_build", "Version.", value={"version": version("surefoot")})
        yield from _of_cameras(self._metrics)
        yield from _of_looks(self._metrics)
        yield from _of_runs(self._metrics)
        yield from _of_alerts(self._metrics)
        yield from _of_webhooks(self._metrics)
        yield from _of_service(self._metrics)
        yield from _of_bridges(self._metrics)
        for other in self._others:
            yield from other.collect()


def _of_cameras(metrics: Metrics) -> Iterator[Metric]:
    count = Counter(camera.state for camera in metrics.cameras)
    drifts = [(c.camera_id, c.drift) for c in metrics.cameras if c.drift is not None]
    yield _gauge(
        "surefoot_cameras", "Cameras by state.", ["state"], {(s,): count[s] for s in PoseState}
    )
    yield _gauge(
        "surefoot_camera_state",
        "1 for the state that a camera is in.",
        ["camera_id", "state"],
        {(c.camera_id, state): c.state == state for c in metrics.cameras for state in PoseState},
    )
    yield _gauge(
        "surefoot_camera_last_track_timestamp_seconds",
        "When the newest track of a camera ended, by the tracks' own clock.",
        ["camera_id"],
        {(c.camera_id,): c.last_track_s for c in metrics.cameras if c.last_track_s is not None},
    )
    yield _gauge(
        "surefoot_camera_moved_probability",
        "The probability that a camera has moved, by its newest estimate.",
        ["camera_id"],
        {(c.camera_id,): c.estimate.moved for c in metrics.cameras if c.estimate is not None},
    )
    yield _gauge(
        "surefoot_camera_drift_radians",
        "Drift of tilt, roll or heading against the prior pose, where it is identifiable.",
        ["camera_id", "number"],
        {(i, n): drift.by.of(n) for i, drift in drifts for n in ANGLES if n in drift.identifiable},
    )
    yield _gauge(
        "surefoot_camera_drift_height_meters",
        "Drift of the height against the prior pose, where it is identifiable.",
        ["camera_id"],
        {(i,): drift.by.height_m for i, drift in drifts if "height" in drift.identifiable},
    )


def _of_looks(metrics: Metrics) -> Iterator[Metric]:
    yield _gauge(
        "surefoot_camera_oldest_unseen_track_seconds",
        "Age of a camera's oldest track that nothing has looked at; 0: there is none.",
        ["camera_id"],
        {(c.camera_id,): metrics.unseen_s.get(c.camera_id, 0.0) for c in metrics.cameras},
    )
    yield _gauge(
        "surefoot_camera_estimate_failing",
        "1 for a camera whose last look failed.",
        ["camera_id"],
        {(c.camera_id,): c.camera_id in metrics.failing for c in metrics.cameras},
    )
    failing = "Cameras whose last look failed."
    yield GaugeMetricFamily("surefoot_cameras_failing", failing, value=len(metrics.failing))


def _of_runs(metrics: Metrics) -> Iterator[Metric]:
    runs = CounterMetricFamily(
        "surefoot_estimation_runs",
        "Estimation runs: monitor updates the drift chart alone, full also the pose.",
        labels=["kind"],
    )
    cpu = CounterMetricFamily(
        "surefoot_estimation_cpu_seconds", "CPU time of estimation runs.", labels=["kind"]
    )
    for kind, total in metrics.runs.items():
        runs.add_metric([kind], total.runs)
        cpu.add_metric([kind], total.cpu_s)
    yield runs
    yield cpu
    yield _gauge(
        "surefoot_result_age_seconds",
        "Age of results relative to the newest track of each camera, over all cameras.",
        ["kind", "statistic"],
        {
            (kind, statistic): value
            for kind, ages in metrics.result_ages.items()
            for statistic, value in (
                ("median", ages.median_s),
                ("p95", ages.p95_s),
                ("max", ages.worst_s),
            )
        },
    )


def _of_alerts(metrics: Metrics) -> Iterator[Metric]:
    zeros = dict.fromkeys(product(AlertKind, Severity), 0)
    alone = [alert for alert in metrics.alerts if alert.group_id is None]
    count = Counter((alert.kind, alert.severity) for alert in alone)
    yield _gauge(
        "surefoot_alerts_firing",
        "Alerts that fire, silenced or not; a group and its members are one.",
        ["kind", "severity"],
        {**zeros, **count},
    )
    silenced = [alert for alert in metrics.alerts if alert.is_silenced(metrics.at)]
    grouped = [alert for alert in metrics.alerts if alert.group_id is not None]
    for name, which, chosen in (
        ("firing", "fires, silenced or not, in a group or not", metrics.alerts),
        ("silenced", "fires and is silenced", silenced),
        ("grouped", "fires and is in a group", grouped),
    ):
        found = {(alert.camera_id or "", alert.kind): 1 for alert in chosen}
        words = f"1 for an alert that {which}."
        yield _gauge(f"surefoot_alert_{name}", words, ["camera_id", "kind"], found)


def _of_webhooks(metrics: Metrics) -> Iterator[Metric]:
    for name, text, field in (
        ("surefoot_webhook_enabled", "1 while messages are sent to a webhook.", "enabled"),
        ("surefoot_webhook_failing_seconds", "Since its last success; 0: fine.", "failing_s"),
        ("surefoot_deliveries_pending", "Messages that wait for a webhook.", "pending"),
        ("surefoot_delivery_oldest_pending_seconds", "Age of the oldest of them.", "oldest_s"),
    ):
        found = {(w.webhook_id, w.name): getattr(w, field) for w in metrics.webhooks}
        yield _gauge(name, text, ["webhook_id", "webhook_name"], found)


def _of_service(metrics: Metrics) -> Iterator[Metric]:
    yield _gauge(
        "surefoot_trainings",
        "Trainings that are stored, by state.",
        ["state"],
        {(state,): metrics.trainings.get(state, 0) for state in TrainingState},
    )
    yield _gauge(
        "surefoot_worker_last_heartbeat_timestamp_seconds",
        "When a worker was last heard of.",
        ["worker"],
        {(name,): at_s for name, at_s in metrics.heartbeats_s.items()},
    )
    restarts = CounterMetricFamily(
        "surefoot_worker_restarts",
        "How often a worker has been started anew, by whoever minds it.",
        labels=["worker"],
    )
    for name, starts in metrics.worker_starts.items():
        restarts.add_metric([name], max(starts - 1, 0))
    yield restarts
    lag = "Age of the oldest track that nothing has looked at, of all cameras."
    yield GaugeMetricFamily("surefoot_queue_lag_seconds", lag, value=metrics.queue_lag_s)
    yield CounterMetricFamily("surefoot_events", "Events ever written.", value=metrics.events)


def _of_bridges(metrics: Metrics) -> Iterator[Metric]:
    known = metrics.bridges
    for name, text, values in (
        (
            "surefoot_bridge_last_heartbeat_timestamp_seconds",
            "When a bridge last reported.",
            {(b.name,): b.heartbeat_at.timestamp() for b in known},
        ),
        (
            "surefoot_bridge_connected",
            "1 while a bridge is connected to its broker.",
            {(b.name,): bool(b.report.get("connected")) and not b.stopped for b in known},
        ),
        (
            "surefoot_bridge_tracks_waiting",
            "Tracks that a bridge has not posted yet.",
            {(b.name,): b.report.get("waiting", 0) for b in known},
        ),
    ):
        yield _gauge(name, text, ["bridge"], values)
    restarts = CounterMetricFamily(
        "surefoot_bridge_restarts", "How often a bridge was started again.", labels=["bridge"]
    )
    counts = CounterMetricFamily(
        "surefoot_bridge_items",
        "Messages, rows and tracks that a bridge has handled since it started, by outcome.",
        labels=["bridge", "outcome"],
    )
    for bridge in known:
        restarts.add_metric([bridge.name], max(bridge.starts - 1, 0))
        for outcome in COUNTS:
            found = bridge.report.get("counts", {}).get(outcome, 0)
            counts.add_metric([bridge.name, outcome], found)
    yield restarts
    yield counts


def _gauge(
    name: str, text: str, labels: list[str], values: Mapping[Any, float]
) -> GaugeMetricFamily:
    family = GaugeMetricFamily(name, text, labels=labels)
    for label_values, value in values.items():
        family.add_metric(label_values, float(value))
    return family


router = APIRouter(tags=["operation"])

_FORMATS = dict.fromkeys(
    ("text/plain", "application/openmetrics-text"), {"schema": {"type": "string"}}
)


@router.get("/healthz")
async def get_health() -> HealthOut:
    """Check that the process answers.

    The check needs no thread and no connection to the database.
    """
    return HealthOut(status=Health.OK)


@router.get("/readyz", responses={503: {"model": ReadyOut}})
def get_readiness(state: StateDep, caller: CallerDep, response: Response) -> ReadyOut:
    """Check that the service is ready.

    The store has to be writable, a worker alive, and the queue short enough.
    """
    readiness = checks.check_readiness(state.store, state.settings)
    if not readiness.ready:
        response.status_code = 503
    status = Readiness.READY if readiness.ready else Readiness.NOT_READY
    body = ReadyOut.of(readiness, status=status)
    if auth_on(state.settings) and caller is None:
        body.problems = []  # they name cameras and files
    return body


@router.get("/metrics", response_class=Response, responses={200: {"content": _FORMATS}})
def get_metrics(
    state: StateDep, session: ReadDep, accept: Annotated[str, Header()] = ""
) -> Response:
    """Get the metrics.

    They are in the Prometheus text format or OpenMetrics.
    """
    encode, media_type = choose_encoder(accept)
    found = load_metrics(session, state.settings)
    text = encode(MetricsCollector(found, state.instruments.registry))
    return Response(text, media_type=media_type)
