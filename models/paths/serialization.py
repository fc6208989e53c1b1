"""The paths of a site as bytes: in whole numbers where their map is rounded to these."""

import numpy as np

from models.errors import CheckpointError
from models.paths.coverage import coverage_of
from models.paths.density_map import PathDensityMap, of_levels, to_levels
from models.paths.reference import PathReference
from models.serialization import Format, flattened, from_bytes, restored, to_bytes, under

_FORMAT = Format(name="paths", version=1)


def paths_to_bytes(reference: PathReference) -> bytes:
    """A reference as it is stored."""
    values = flattened(reference)
    for name in flattened(reference.coverage, "coverage."):
        del values[name]  # made anew of the map
    values["density.log_density"] = to_levels(reference.density.log_density)
    values["density.unseen"] = np.rint(reference.density.unseen * 255).astype(np.uint8)
    return to_bytes(_FORMAT, values)


def paths_from_bytes(data: bytes) -> PathReference:
    """The reference of `paths_to_bytes`.

    Raises:
        CheckpointError: the bytes are no paths of this format.
    """
    values = from_bytes(_FORMAT, data)
    try:
        values["density.log_density"] = of_levels(values["density.log_density"])
        values["density.unseen"] = values["density.unseen"] / 255
    except KeyError as error:
        raise CheckpointError(f"paths: {error} is missing") from error
    density = restored(PathDensityMap, under(values, "density"))
    return restored(PathReference, values, coverage=coverage_of(density))
