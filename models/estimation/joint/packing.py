"""A site's reference as bytes: arrays and numbers, no code."""

import io
from dataclasses import asdict
from typing import Any

import numpy as np

from models.errors import CheckpointError
from models.estimation.joint.field import Field
from models.estimation.joint.fit import Learned
from models.estimation.joint.hierarchy import Spread
from models.estimation.joint.site import SiteReference

_FORMAT = 1


def reference_to_bytes(reference: SiteReference) -> bytes:
    """NumPy's `.npz` of a reference, but for its doubt, which is told once."""
    values: dict[str, Any] = {
        "format": _FORMAT,
        "offset": reference.offset,
        "offset_covariance": reference.offset_covariance,
        "inflation": reference.inflation,
        "tracks": reference.tracks,
        "boxes": reference.boxes,
        **_learned_arrays("speeds", reference.speeds),
    }
    if reference.statures is not None:
        values |= _learned_arrays("statures", reference.statures)
    with io.BytesIO() as file:
        np.savez_compressed(file, **values)
        return file.getvalue()


def reference_from_bytes(data: bytes) -> SiteReference:
    """The reference of `reference_to_bytes`.

    Raises:
        CheckpointError: the bytes are no reference of this format.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            values = {name: file[name] for name in file.files}
        if int(values["format"]) != _FORMAT:
            raise CheckpointError(f"format: {_FORMAT} is needed, got {values['format']}")
        return SiteReference(
            speeds=_learned_of("speeds", values),
            statures=_learned_of("statures", values) if "statures_mean" in values else None,
            offset=values["offset"],
            offset_covariance=values["offset_covariance"],
            inflation=float(values["inflation"]),
            tracks=int(values["tracks"]),
            boxes=str(values["boxes"]),
        )
    except (OSError, ValueError, KeyError) as error:
        raise CheckpointError(f"reference: not readable: {error!r}") from error


def _learned_arrays(name: str, learned: Learned) -> dict[str, Any]:
    field = learned.field
    return {
        f"{name}_centres": field.centres,
        f"{name}_length_m": field.length_m,
        f"{name}_directional": field.directional,
        f"{name}_prior_mean": field.prior_mean,
        f"{name}_prior_variance": field.prior_variance,
        f"{name}_mean": learned.mean,
        f"{name}_covariance": learned.covariance,
        f"{name}_usual": learned.usual,
        **{f"{name}_{key}": value for key, value in asdict(learned.spread).items()},
    }


def _learned_of(name: str, values: dict[str, Any]) -> Learned:
    spread = {key: float(values[f"{name}_{key}"]) for key in Spread.__dataclass_fields__}
    return Learned(
        field=Field(
            centres=values[f"{name}_centres"],
            length_m=float(values[f"{name}_length_m"]),
            directional=bool(values[f"{name}_directional"]),
            prior_mean=values[f"{name}_prior_mean"],
            prior_variance=values[f"{name}_prior_variance"],
        ),
        mean=values[f"{name}_mean"],
        covariance=values[f"{name}_covariance"],
        spread=Spread(**spread),
        usual=float(values[f"{name}_usual"]),
    )
