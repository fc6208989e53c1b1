"""Where an estimate may begin, as bytes: some kilobytes, stored with each."""

from dataclasses import replace
from typing import Any

from models.errors import CheckpointError
from models.geometry.rotation import Array
from models.pose.fusion import Around
from models.pose.warm_start import LastPose
from models.serialization import Format, flattened, from_bytes, restored, to_bytes
from models.walking.fit import Near

_FORMAT = Format(name="last_pose", version=2)


def last_pose_to_bytes(last: LastPose) -> bytes:
    """A last pose as it is stored."""
    values = flattened(replace(last, means=(), around=None))
    del values["means"]
    values |= _numbered("means", last.means)
    if last.around is not None:
        values |= {"wider": last.around.wider, "told": last.around.told.raw}
        values |= _numbered("told_means", last.around.told.means)
    return to_bytes(_FORMAT, values)


def last_pose_from_bytes(data: bytes) -> LastPose:
    """The last pose of `last_pose_to_bytes`.

    Raises:
        CheckpointError: the bytes are no last pose of this format.
    """
    values = from_bytes(_FORMAT, data)
    try:
        given: dict[str, Any] = {
            "means": _taken(values, "means"),
            "identifiable": tuple(values.pop("identifiable")),
            "around": None,
        }
        if "wider" in values:
            told = Near(raw=values.pop("told"), means=_taken(values, "told_means"))
            given["around"] = Around(told=told, wider=values.pop("wider"))
    except KeyError as error:
        raise CheckpointError(f"last_pose: {error} is missing") from error
    return restored(LastPose, values, said=values.pop("said", None), **given)


def _numbered(name: str, arrays: tuple[Array, ...]) -> dict[str, Any]:
    return {f"{name}.{at}": each for at, each in enumerate(arrays)}


def _taken(values: dict[str, Any], name: str) -> tuple[Array, ...]:
    """The arrays of `_numbered`, which are taken out of the values."""
    count = sum(key.startswith(f"{name}.") for key in values)
    return tuple(values.pop(f"{name}.{at}") for at in range(count))
