"""A drift chart and a creep log as bytes."""

from models.errors import CheckpointError
from models.monitoring.chart import KNOCKS, DriftChart
from models.monitoring.creep_log import CreepLog
from models.serialization import Format, flattened, pack, restored, unpack

_CHART = Format(name="chart", version=1)
_CREEP_LOG = Format(name="creep", version=1)


def chart_to_bytes(chart: DriftChart) -> bytes:
    """A chart as it is stored."""
    return pack(_CHART, flattened(chart))


def chart_from_bytes(data: bytes) -> DriftChart:
    """The chart of `chart_to_bytes`.

    Raises:
        CheckpointError: the bytes are no chart of this format, or of another grid of knocks.
    """
    chart = restored(DriftChart, unpack(_CHART, data))
    if chart.responses.shape[1] != len(KNOCKS):
        raise CheckpointError(
            f"responses: {len(KNOCKS)} knocks are needed, got {chart.responses.shape[1]}"
        )
    return chart


def creep_log_to_bytes(log: CreepLog) -> bytes:
    """A log as it is stored."""
    return pack(_CREEP_LOG, flattened(log))


def creep_log_from_bytes(data: bytes) -> CreepLog:
    """The log of `creep_log_to_bytes`.

    Raises:
        CheckpointError: the bytes are no log of this format.
    """
    return restored(CreepLog, unpack(_CREEP_LOG, data))
