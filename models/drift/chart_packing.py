"""A drift chart as bytes: arrays and numbers, no code."""

import io
import zipfile
from dataclasses import fields

import numpy as np

from models.drift.chart import KNOCKS, DriftChart
from models.errors import CheckpointError
from models.estimation.joint.packing import reference_from_bytes, reference_to_bytes

_FORMAT = 1


def chart_to_bytes(chart: DriftChart) -> bytes:
    """NumPy's `.npz` of a chart."""
    values = {field.name: getattr(chart, field.name) for field in fields(chart)}
    values["paces"] = np.frombuffer(reference_to_bytes(chart.paces), dtype=np.uint8)
    with io.BytesIO() as file:
        np.savez_compressed(file, format=_FORMAT, **values)
        return file.getvalue()


def chart_from_bytes(data: bytes) -> DriftChart:
    """The chart of `chart_to_bytes`.

    Raises:
        CheckpointError: the bytes are no chart of this format, or of another grid of knocks.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            values = {name: file[name] for name in file.files}
        if int(values.pop("format")) != _FORMAT:
            raise CheckpointError(f"format: a chart of format {_FORMAT} is needed")
        if values["responses"].shape[1] != len(KNOCKS):
            raise CheckpointError(
                f"responses: {len(KNOCKS)} knocks are needed, got {values['responses'].shape[1]}"
            )
        paces = reference_from_bytes(values.pop("paces").tobytes())
        numbers = {name: part if part.ndim else part.item() for name, part in values.items()}
        return DriftChart(paces=paces, **numbers)
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"chart: not readable: {error!r}") from error
