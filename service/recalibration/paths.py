"""Where people walk before a camera, and the chart of its drift: learned together."""

from dataclasses import dataclass

from models.drift.chart_learning import learn_chart
from models.drift.chart_packing import chart_to_bytes
from models.estimation.joint.observations import Observations
from models.estimation.joint.site import SiteReference
from models.flow.folds import fold_maps
from models.flow.packing import flow_to_bytes
from models.flow.reference import candidate_of, learn_flow
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedPaths:
    """A flow map and the drift chart that goes with it, as bytes."""

    flow: bytes
    chart: bytes | None


def learn_paths(
    observations: Observations,
    intrinsics: Intrinsics,
    prior: CameraPose,
    site: SiteReference,
    seed: int,
    weights: Array | None = None,
) -> LearnedPaths | None:
    """The map and the chart of tracks at the prior pose; None where too few parties walk."""
    folds = fold_maps(observations, intrinsics, candidate_of(prior), seed, weights)
    if folds is None:
        return None
    flow = learn_flow(observations, intrinsics, prior, seed, weights, folds)
    assert flow is not None
    chart = learn_chart(observations, prior, site, folds, seed)
    return LearnedPaths(
        flow=flow_to_bytes(flow), chart=None if chart is None else chart_to_bytes(chart)
    )
