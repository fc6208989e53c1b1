"""A creep log as bytes."""

from models.monitoring.creep_log import CreepLog
from models.serialization import Format, flattened, pack, restored, unpack

_FORMAT = Format(name="creep", version=1)


def creep_log_to_bytes(log: CreepLog) -> bytes:
    """A log as it is stored."""
    return pack(_FORMAT, flattened(log))


def creep_log_from_bytes(data: bytes) -> CreepLog:
    """The log of `creep_log_to_bytes`.

    Raises:
        CheckpointError: the bytes are no log of this format.
    """
    return restored(CreepLog, unpack(_FORMAT, data))
