"""A site's flow as bytes: arrays and numbers, no code."""

import io
import zipfile
from dataclasses import fields
from typing import Any

import numpy as np

from models.errors import CheckpointError
from models.flow.fit import UsualFit
from models.flow.flow_map import FlowMap
from models.flow.move import StillScores
from models.flow.reference import FlowReference
from models.flow.rounding import of_levels, to_levels
from models.flow.view import coverage_of

_FORMAT = 1
_NESTED = ("flow", "coverage", "still", "fit")


def flow_to_bytes(reference: FlowReference) -> bytes:
    """NumPy's `.npz` of a reference, in whole numbers where its map is rounded to these."""
    flow = reference.flow
    values: dict[str, Any] = {"format": _FORMAT}
    for name, value in (("flow", flow), ("still", reference.still), ("fit", reference.fit)):
        values |= {f"{name}.{key}": part for key, part in _fields(value).items()}
    values |= {key: part for key, part in _fields(reference).items() if key not in _NESTED}
    values["flow.log_density"] = to_levels(flow.log_density)
    values["flow.unseen"] = np.rint(flow.unseen * 255).astype(np.uint8)
    with io.BytesIO() as file:
        np.savez_compressed(file, **values)
        return file.getvalue()


def flow_from_bytes(data: bytes) -> FlowReference:
    """The reference of `flow_to_bytes`.

    Raises:
        CheckpointError: the bytes are no flow of this format.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            values = {name: file[name] for name in file.files}
        if int(values["format"]) != _FORMAT:
            raise CheckpointError(f"format: {_FORMAT} is needed, got {values['format']}")
        values["flow.log_density"] = of_levels(values["flow.log_density"])
        values["flow.unseen"] = values["flow.unseen"] / 255
        flow = FlowMap(**_taken(FlowMap, values, "flow."))
        return FlowReference(
            flow=flow,
            coverage=coverage_of(flow),
            still=StillScores(**_taken(StillScores, values, "still.")),
            fit=UsualFit(**_taken(UsualFit, values, "fit.")),
            **_taken(FlowReference, values, ""),
        )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"flow: not readable: {error!r}") from error


def _fields(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in fields(value)}


def _taken(kind: Any, values: dict[str, Any], prefix: str) -> dict[str, Any]:
    """What is stored of a kind's fields: arrays, and numbers where these have no axes."""
    names = [field.name for field in fields(kind) if prefix or field.name not in _NESTED]
    found = {name: values[prefix + name] for name in names}
    return {name: part if part.ndim else part.item() for name, part in found.items()}
