"""A site's reference as bytes."""

from dataclasses import replace

from models.serialization import Format, flattened, pack, restored, unpack
from models.walking.speed_reference import SpeedReference

_FORMAT = Format(name="site", version=1)


def reference_to_bytes(reference: SpeedReference) -> bytes:
    """A reference as it is stored, but for what is implausible, which has a column of its own."""
    return pack(_FORMAT, flattened(replace(reference, implausible=None)))


def reference_from_bytes(data: bytes) -> SpeedReference:
    """The reference of `reference_to_bytes`.

    Raises:
        CheckpointError: the bytes are no reference of this format.
    """
    return restored(SpeedReference, unpack(_FORMAT, data), implausible=None)
