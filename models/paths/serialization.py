"""A site's flow as bytes: in whole numbers where its map is rounded to these."""

import numpy as np

from models.errors import CheckpointError
from models.paths.map.density_map import FlowMap
from models.paths.map.rounding import of_levels, to_levels
from models.paths.map.view import coverage_of
from models.paths.reference import FlowReference
from models.serialization import Format, flattened, from_bytes, restored, to_bytes, under

_FORMAT = Format(name="flow", version=1)


def flow_to_bytes(reference: FlowReference) -> bytes:
    """A reference as it is stored."""
    values = flattened(reference)
    for name in flattened(reference.coverage, "coverage."):
        del values[name]  # made anew of the map
    values["flow.log_density"] = to_levels(reference.flow.log_density)
    values["flow.unseen"] = np.rint(reference.flow.unseen * 255).astype(np.uint8)
    return to_bytes(_FORMAT, values)


def flow_from_bytes(data: bytes) -> FlowReference:
    """The reference of `flow_to_bytes`.

    Raises:
        CheckpointError: the bytes are no flow of this format.
    """
    values = from_bytes(_FORMAT, data)
    try:
        values["flow.log_density"] = of_levels(values["flow.log_density"])
        values["flow.unseen"] = values["flow.unseen"] / 255
    except KeyError as error:
        raise CheckpointError(f"flow: {error} is missing") from error
    flow = restored(FlowMap, under(values, "flow"))
    return restored(FlowReference, values, coverage=coverage_of(flow))
