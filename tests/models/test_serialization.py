"""The codec of stored models: what is packed comes back to the bit, and nothing else is read."""

import gzip
import io
import json
import math
import os
import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from safetensors.numpy import load

from models.errors import CheckpointError
from models.serialization import Format, flattened, from_bytes, restored, stored_as, to_bytes, under

FORM = Format(name="site", version=3)
VALUES = {
    "turned": np.arange(6.0).reshape(2, 3).T,  # lies column by column
    "empty": np.empty((0, 2)),
    "levels": np.array([[-3, 500]], dtype=np.int16),
    "big_endian": np.array([1.5, 2.5], dtype=">f8"),
    "tenth": 0.1,
    "most": math.inf,
    "scalar": np.float64(1 / 3),
    "count": 7,
    "directional": True,
    "doubt": "the scale: 8 m/s \N{RIGHTWARDS ARROW} no people",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    mean: np.ndarray
    usual: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer:
    first: Inner
    second: Inner | None
    tracks: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Renamed:
    inner: Inner = stored_as("paces")
    groups: int = stored_as("parties")


def test_what_is_packed_comes_back_to_the_bit():
    found = from_bytes(FORM, to_bytes(FORM, VALUES))
    assert set(found) == set(VALUES)
    for name, value in VALUES.items():
        assert_array_equal(found[name], value)
        assert isinstance(found[name], np.ndarray) == isinstance(value, np.ndarray)
    assert found["levels"].dtype == np.int16
    assert type(found["count"]) is int
    assert type(found["scalar"]) is float
    found["levels"][:] = 0  # one's own


def test_the_same_values_make_the_same_bytes_in_any_order():
    assert to_bytes(FORM, dict(reversed(VALUES.items()))) == to_bytes(FORM, VALUES)


def test_bytes_are_a_safetensors_file_under_gzip():
    raw = gzip.decompress(to_bytes(FORM, VALUES))
    assert_array_equal(load(raw)["turned"], VALUES["turned"])
    header = json.loads(raw[8 : 8 + int.from_bytes(raw[:8], "little")])
    said = json.loads(header["__metadata__"]["surefoot"])
    assert (said["format"], said["version"], said["values"]["count"]) == ("site", 3, 7)


@pytest.mark.parametrize(
    "wrong",
    [
        b"",
        b"nothing",
        b"PK\x03\x04 of an earlier release",
        to_bytes(FORM, VALUES)[:-9],
        gzip.compress(b"", mtime=0),
        gzip.compress(b"\xff" * 99, mtime=0),
        gzip.compress(
            b"\x02" + b"\x00" * 7 + b"{}", mtime=0
        ),  # a safetensors file with nothing in it
        bytes(byte ^ (n == 200) for n, byte in enumerate(to_bytes(FORM, VALUES))),
    ],
)
def test_what_is_damaged_is_named_so(wrong):
    with pytest.raises(CheckpointError, match="^site: not readable"):
        from_bytes(FORM, wrong)


class Touch:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


def test_nothing_that_is_stored_is_run(tmp_path):
    """A pickle, numpy's file with one in it, and one among the values: none is read as such."""
    touch = Touch(tmp_path / "pwned")
    with_objects = io.BytesIO()
    np.save(with_objects, np.array([touch], dtype=object), allow_pickle=True)
    for code in (pickle.dumps(touch), with_objects.getvalue()):
        for data in (code, gzip.compress(code)):
            with pytest.raises(CheckpointError, match="not readable"):
                from_bytes(FORM, data)
    told = pickle.dumps(touch, protocol=0).decode()
    assert from_bytes(FORM, to_bytes(FORM, {"doubt": told}))["doubt"] == told
    assert not (tmp_path / "pwned").exists()


def test_what_grows_beyond_its_limit_is_not_unpacked():
    bomb = gzip.compress(bytes(2**26))
    assert len(bomb) < 2**17
    with pytest.raises(CheckpointError, match="over 1048576 bytes when unpacked"):
        from_bytes(FORM, bomb, most_bytes=2**20)


@pytest.mark.parametrize("other", [Format(name="site", version=2), Format(name="flow", version=3)])
def test_another_format_or_version_is_named_so(other):
    needed = f"^format: {other.name} {other.version} is needed, got site 3$"
    with pytest.raises(CheckpointError, match=needed):
        from_bytes(other, to_bytes(FORM, VALUES))


def test_dataclasses_in_dataclasses_have_dotted_names():
    whole = Outer(first=Inner(mean=np.ones(2), usual=1.0), second=None, tracks=3)
    values = flattened(whole)
    assert set(values) == {"first.mean", "first.usual", "tracks"}
    again = restored(Outer, values)
    assert (again.second, again.tracks, again.first.usual) == (None, 3, 1.0)
    assert again.first.mean is whole.first.mean
    both = restored(Outer, {**values, "second.mean": np.zeros(1), "second.usual": 2.0})
    assert both.second is not None
    assert both.second.usual == 2.0
    assert under(values, "first") == {"mean": whole.first.mean, "usual": 1.0}
    assert restored(Outer, {"tracks": 3}, first=both.first, second=None).first is both.first


def test_a_field_may_be_stored_under_an_older_name():
    whole = Renamed(inner=Inner(mean=np.ones(2), usual=1.0), groups=3)
    values = flattened(whole)
    assert set(values) == {"paces.mean", "paces.usual", "parties"}
    again = restored(Renamed, values)
    assert (again.groups, again.inner.usual) == (3, 1.0)
    with pytest.raises(CheckpointError, match=r"^Renamed: parties is missing$"):
        restored(Renamed, {"groups": 3}, inner=whole.inner)


@pytest.mark.parametrize(
    ("lost", "more", "reason"),
    [
        ("tracks", {}, "Outer: tracks is missing"),
        ("first.usual", {}, "Inner: usual is missing"),
        ("", {"first.sd": 1.0}, "Inner: has no sd"),
        ("", {"second.usual": 1.0}, "Inner: mean is missing"),
        ("", {"people": 1, "age": 2}, "Outer: has no age, people"),
    ],
)
def test_other_fields_are_named(lost, more, reason):
    values = {"first.mean": np.ones(2), "first.usual": 1.0, "tracks": 3, **more}
    values.pop(lost, None)
    with pytest.raises(CheckpointError, match=f"^{reason}$"):
        restored(Outer, values)
