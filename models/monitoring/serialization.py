"""A drift chart and a creep log as bytes."""

from models.errors import CheckpointError
from models.monitoring.chart import OFFSET_GRID, DriftChart
from models.monitoring.creep_log import CreepLog
from models.serialization import Format, flattened, from_bytes, restored, to_bytes

_CHART = Format(name="chart", version=1)
_CREEP_LOG = Format(name="creep", version=1)


def chart_to_bytes(chart: DriftChart) -> bytes:
    """A chart as it is stored."""
    return to_bytes(_CHART, flattened(chart))


def chart_from_bytes(data: bytes) -> DriftChart:
    """The chart of `chart_to_bytes`.

    Raises:
        CheckpointError: the bytes are no chart of this format, or of another grid of offsets.
    """
    chart = restored(DriftChart, from_bytes(_CHART, data))
    if chart.responses.shape[1] != len(OFFSET_GRID):
        raise CheckpointError(
            f"responses: {len(OFFSET_GRID)} offsets are needed, got {chart.responses.shape[1]}"
        )
    return chart


def creep_log_to_bytes(log: CreepLog) -> bytes:
    """A log as it is stored."""
    return to_bytes(_CREEP_LOG, flattened(log))


def creep_log_from_bytes(data: bytes) -> CreepLog:
    """The log of `creep_log_to_bytes`.

    Raises:
        CheckpointError: the bytes are no log of this format.
    """
    return restored(CreepLog, from_bytes(_CREEP_LOG, data))
