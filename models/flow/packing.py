"""A site's flow as bytes: arrays and numbers, no code."""

import io
import zipfile
from dataclasses import fields
from typing import Any

import numpy as np

from models.errors import CheckpointError
from models.flow.flow_map import FlowMap, coverage_of
from models.flow.reference import FlowReference
from models.flow.rounding import of_levels, to_levels

_FORMAT = 1
# What is stored in a form of its own; all other fields are arrays or plain numbers and words.
_OWN_FORM = ("flow", "coverage")
_FIELDS = tuple(field.name for field in fields(FlowReference) if field.name not in _OWN_FORM)


def flow_to_bytes(reference: FlowReference) -> bytes:
    """NumPy's `.npz` of a reference, its log densities rounded to 1/64."""
    flow = reference.flow
    values: dict[str, Any] = {
        "format": _FORMAT,
        "map_corner": flow.corner,
        "map_cell_m": flow.cell_m,
        "map_elsewhere": flow.elsewhere,
        "map_levels": to_levels(flow.log_density),
        **{name: getattr(reference, name) for name in _FIELDS},
    }
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
        flow = FlowMap(
            corner=values["map_corner"],
            cell_m=float(values["map_cell_m"]),
            log_density=of_levels(values["map_levels"]),
            elsewhere=float(values["map_elsewhere"]),
        )
        rest = {name: _plain(values[name]) for name in _FIELDS}
        return FlowReference(flow=flow, coverage=coverage_of(flow), **rest)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"flow: not readable: {error!r}") from error


def _plain(array: Any) -> Any:
    """An array, or the number or the words that one without axes holds."""
    return array.item() if array.ndim == 0 else array
