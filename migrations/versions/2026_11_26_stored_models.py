"""Stored models are safetensors files under gzip; they were NumPy's archives, one in another."""

import gzip
import io
import json
import zipfile
import zlib
from collections.abc import Callable

import numpy as np
import sqlalchemy as sa
from alembic import op
from safetensors import SafetensorError
from safetensors.numpy import load, save

revision = "2026_11_26_stored_models"
down_revision = "2026_11_26_radians_of_alerts"
branch_labels = None
depends_on = None

# Table, key, column, format.
_STORED = (
    ("site_references", "id", "data", "site"),
    ("flow_maps", "reference_id", "data", "flow"),
    ("flow_maps", "reference_id", "chart", "chart"),
)
_FIELD = ("centres", "length_m", "directional", "prior_mean", "prior_variance")
_SPREAD = (
    "between_sd",
    "trend_sd",
    "within_sd",
    "correlation",
    "other_share",
    "other_mean",
    "other_sd",
)
_LEARNED = {
    **{name: name for name in ("mean", "covariance", "usual")},
    **{name: f"field.{name}" for name in _FIELD},
    **{name: f"spread.{name}" for name in _SPREAD},
}
# Of a site, as they were and as they are; what is not named is called as it was.
_SITE = {
    f"{channel}_{old}": f"{channel}.{new}"
    for channel in ("speeds", "statures")
    for old, new in _LEARNED.items()
}
_UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    TypeError,
    zipfile.BadZipFile,
    zlib.error,
    SafetensorError,
)


def upgrade() -> None:
    _rewrite(_packed)


def downgrade() -> None:
    _rewrite(_archived)


def _rewrite(made_of: Callable[[str, bytes], bytes]) -> None:
    """Write each stored model anew, one in memory at a time."""
    connection = op.get_bind()
    for table, key, column, form in _STORED:
        rows = sa.table(table, sa.column(key), sa.column(column))
        stored, ids = rows.c[column], rows.c[key]
        for row_id in connection.scalars(sa.select(ids).where(stored.is_not(None))).all():
            data = connection.scalars(sa.select(stored).where(ids == row_id)).one()
            try:
                new = made_of(form, bytes(data))
            except _UNREADABLE:
                continue  # nobody could read it before, nor can now: it is told of as it was
            connection.execute(sa.update(rows).where(ids == row_id).values({column: new}))


def _packed(form: str, data: bytes) -> bytes:
    values = _read_archive(data)
    if form == "site":
        values = {_SITE.get(name, name): part for name, part in values.items()}
    if form == "chart":
        paces = _read_archive(values.pop("paces").tobytes())
        values |= {f"paces.{_SITE.get(name, name)}": part for name, part in paces.items()}
    arrays = {name: np.ascontiguousarray(part) for name, part in values.items() if part.ndim}
    rest = {name: part.item() for name, part in values.items() if not part.ndim}
    header = {"format": form, "version": 1, "values": rest}
    metadata = {"surefoot": json.dumps(header, sort_keys=True)}
    return gzip.compress(save(arrays, metadata=metadata), mtime=0)


def _archived(form: str, data: bytes) -> bytes:
    raw = gzip.decompress(data)
    length = int.from_bytes(raw[:8], "little")
    header = json.loads(json.loads(raw[8 : 8 + length])["__metadata__"]["surefoot"])
    if (header["format"], header["version"]) != (form, 1):
        raise ValueError(f"format: {form} 1 is needed, got {header['format']}")
    values = {**header["values"], **load(raw)}
    old = {new: old for old, new in _SITE.items()}
    if form == "site":
        values = {old.get(name, name): part for name, part in values.items()} | {"doubt": ""}
    if form == "chart":
        names = [name for name in values if name.startswith("paces.")]
        paces = {name.removeprefix("paces."): values.pop(name) for name in names}
        nested = _write_archive(
            {old.get(name, name): part for name, part in paces.items()} | {"doubt": ""}
        )
        values["paces"] = np.frombuffer(nested, dtype=np.uint8)
    return _write_archive(values)


def _read_archive(data: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        values = {name: file[name] for name in file.files}
    if int(values.pop("format")) != 1:
        raise ValueError("format: 1 is needed")
    values.pop("doubt", None)  # of a site: its row tells it
    return values


def _write_archive(values: dict[str, np.ndarray]) -> bytes:
    with io.BytesIO() as file:
        np.savez_compressed(file, format=1, **values)
        return file.getvalue()
