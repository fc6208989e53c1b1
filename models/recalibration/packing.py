"""Where an estimate may begin, as bytes: some kilobytes, stored with each."""

from dataclasses import replace

from models.errors import CheckpointError
from models.packing import Format, flattened, pack, restored, unpack
from models.recalibration.doubts import LastPose

_FORMAT = Format(name="last_pose", version=1)


def last_pose_to_bytes(last: LastPose) -> bytes:
    """A last pose as it is stored."""
    values = flattened(replace(last, means=()))
    del values["means"]
    return pack(_FORMAT, values | {f"means.{at}": each for at, each in enumerate(last.means)})


def last_pose_from_bytes(data: bytes) -> LastPose:
    """The last pose of `last_pose_to_bytes`.

    Raises:
        CheckpointError: the bytes are no last pose of this format.
    """
    values = unpack(_FORMAT, data)
    means = [name for name in values if name.startswith("means.")]
    try:
        given = {
            "means": tuple(values.pop(f"means.{at}") for at in range(len(means))),
            "identifiable": tuple(values.pop("identifiable")),
        }
    except KeyError as error:
        raise CheckpointError(f"last_pose: {error} is missing") from error
    return restored(LastPose, values, said=values.pop("said", None), **given)
