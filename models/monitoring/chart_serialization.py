"""A drift chart as bytes."""

from models.errors import CheckpointError
from models.monitoring.chart import KNOCKS, DriftChart
from models.serialization import Format, flattened, pack, restored, unpack

_FORMAT = Format(name="chart", version=1)


def chart_to_bytes(chart: DriftChart) -> bytes:
    """A chart as it is stored."""
    return pack(_FORMAT, flattened(chart))


def chart_from_bytes(data: bytes) -> DriftChart:
    """The chart of `chart_to_bytes`.

    Raises:
        CheckpointError: the bytes are no chart of this format, or of another grid of knocks.
    """
    chart = restored(DriftChart, unpack(_FORMAT, data))
    if chart.responses.shape[1] != len(KNOCKS):
        raise CheckpointError(
            f"responses: {len(KNOCKS)} knocks are needed, got {chart.responses.shape[1]}"
        )
    return chart
