"""Where people walk before a camera, and the chart of its drift, as they are stored."""

from dataclasses import dataclass

from models.monitoring.chart_serialization import chart_to_bytes
from models.paths.serialization import paths_to_bytes
from models.pose import CameraSite


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPaths:
    """A flow map and the drift chart that goes with it, as bytes."""

    flow: bytes
    chart: bytes | None


def paths_of(site: CameraSite) -> LearnedPaths | None:
    """The map and the chart of a site; None where too few walking groups walk."""
    if site.paths is None:
        return None
    return LearnedPaths(
        flow=paths_to_bytes(site.paths),
        chart=None if site.chart is None else chart_to_bytes(site.chart),
    )
