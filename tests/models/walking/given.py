"""Values of rows for the mixed model, as a test gives them."""

from typing import NamedTuple

from models.geometry.rotation import Array, Mask
from models.tracks.observations import Rows


class Given(NamedTuple):
    value: Array
    valid: Mask
    rows: Rows
