"""Stored models as bytes: one codec for all that is learned of a site.

A stored model is a safetensors file under gzip: arrays by name, and a header whose one entry is
JSON with the format's name and version and with all that is no array. Nothing in it is code, and
gzip's checksum tells of damage. What a format has in it, its own room says.

Source: the safetensors format, https://github.com/huggingface/safetensors#format.
"""

import gzip
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from io import BytesIO
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from models.errors import CheckpointError

_ENTRY = "surefoot"  # alone in the header: several entries have no order
_STORED = "stored"
_MOST_BYTES = 256 * 2**20  # unpacked: gzip makes a gigabyte of one megabyte
_DAMAGED = (OSError, EOFError, zlib.error, SafetensorError, ValueError, KeyError, TypeError)

Made = TypeVar("Made")


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """Name and version of a stored format; a version is read by its own release and later."""

    name: str
    version: int


def to_bytes(form: Format, values: Mapping[str, Any]) -> bytes:
    """Arrays, numbers and texts by name as bytes: the same values, the same bytes."""
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    rest = {name: _plain(value) for name, value in values.items() if name not in arrays}
    header = {"format": form.name, "version": form.version, "values": rest}
    # safetensors writes memory as it lies, so it has to lie row by row.
    tensors = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    data = save(tensors, metadata={_ENTRY: json.dumps(header, sort_keys=True)})
    return gzip.compress(data, mtime=0)


def from_bytes(form: Format, data: bytes, most_bytes: int = _MOST_BYTES) -> dict[str, Any]:
    """The values of `to_bytes`; arrays of one's own. Unpacked they are of `most_bytes` at most.

    Raises:
        CheckpointError: the bytes are damaged, or of another format or version.
    """
    try:
        raw = _unpacked(data, most_bytes)
        # On a place of their own in memory: those of safetensors lie as they come.
        arrays = {name: array.copy() for name, array in load(raw).items()}
        length = int.from_bytes(raw[:8], "little")
        header = json.loads(json.loads(raw[8 : 8 + length])["__metadata__"][_ENTRY])
        found, values = (header["format"], header["version"]), header["values"]
    except _DAMAGED as error:
        raise CheckpointError(f"{form.name}: not readable: {error!r}") from error
    if found != (form.name, form.version):
        raise CheckpointError(
            f"format: {form.name} {form.version} is needed, got {found[0]} {found[1]}"
        )
    return {**values, **arrays}


def _unpacked(data: bytes, most_bytes: int) -> bytes:
    with gzip.GzipFile(fileobj=BytesIO(data)) as file:
        raw = file.read(most_bytes + 1)
    if len(raw) > most_bytes:
        raise ValueError(f"over {most_bytes} bytes when unpacked")
    return raw


def stored_as(name: str) -> Any:
    """A field that is stored under another name: what is in stores keeps the names it has."""
    return field(metadata={_STORED: name})


def flattened(value: Any, prefix: str = "") -> dict[str, Any]:
    """The fields of a dataclass; those of dataclasses and arrays in it by dotted names, no None."""
    found: dict[str, Any] = {}
    for each in fields(value):
        part, name = getattr(value, each.name), prefix + each.metadata.get(_STORED, each.name)
        if is_dataclass(part):
            found |= flattened(part, f"{name}.")
        elif isinstance(part, tuple) and any(isinstance(own, np.ndarray) for own in part):
            found |= {f"{name}.{number}": own for number, own in enumerate(part)}
        elif part is not None:
            found[name] = part
    return found


def under(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The values of one of the dataclasses in another."""
    start = f"{name}."
    return {key.removeprefix(start): part for key, part in values.items() if key.startswith(start)}


def restored(kind: type[Made], values: Mapping[str, Any], **given: Any) -> Made:
    """The dataclass of `flattened`; fields that are given are not looked for.

    Raises:
        CheckpointError: fields are missing, or there are others.
    """
    made, known = dict(given), set()
    hints = _hints_of(cast(Any, kind))
    for each in fields(cast(Any, kind)):
        if each.name in given:
            continue
        name, hint = each.metadata.get(_STORED, each.name), hints[each.name]
        inner = [part for part in (hint, *get_args(hint)) if is_dataclass(part)]
        parts = under(values, name)
        known |= {name, *(f"{name}.{key}" for key in parts)}
        if inner and (parts or inner[0] is hint):
            made[each.name] = restored(cast(type[Any], inner[0]), parts)
        elif get_origin(hint) is tuple and (parts or name in values):
            own = values[name] if name in values else [parts[str(n)] for n in range(len(parts))]
            made[each.name] = tuple(own)
        elif name in values:
            made[each.name] = values[name]
        elif type(None) in get_args(hint):
            made[each.name] = None
        else:
            raise CheckpointError(f"{kind.__name__}: {name} is missing")
    if strange := sorted(values.keys() - known):
        raise CheckpointError(f"{kind.__name__}: has no {', '.join(strange)}")
    return kind(**made)


@cache
def _hints_of(kind: type[Any]) -> dict[str, Any]:
    return get_type_hints(kind)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
