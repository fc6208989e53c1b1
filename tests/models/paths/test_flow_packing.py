"""A flow reference through bytes and back: what it says hardly changes, and never twice."""

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.errors import CheckpointError
from models.paths.coverage import coverage_of
from models.paths.density_map import of_levels, to_levels
from models.paths.reference import learn_paths, paths_from_bytes, paths_to_bytes
from tests.models.sites import LENS, PRIOR, seen, tracks_of

NESTED = ("density", "coverage", "still", "fit")


@pytest.fixture(scope="module")
def learned():
    (known,) = tracks_of(3, (PRIOR, 60))
    reference = learn_paths(seen(known), LENS, PRIOR, 0)
    assert reference is not None
    return reference


def test_bytes_keep_a_learned_flow_to_the_bit(learned):
    back = paths_from_bytes(paths_to_bytes(learned))
    pairs = [(back, learned)]
    pairs += [(getattr(back, part), getattr(learned, part)) for part in NESTED]
    for found, expected in pairs:
        for field in fields(expected):
            if field.name not in NESTED:
                assert_array_equal(getattr(found, field.name), getattr(expected, field.name))
                assert type(getattr(found, field.name)) is type(getattr(expected, field.name))


def test_rounding_changes_a_log_density_by_less_than_a_hundredth():
    rough = np.linspace(-30, 5, 9999)
    assert_allclose(of_levels(to_levels(rough)), rough, atol=0.008)


def test_what_was_rounded_once_comes_back_to_the_bit(learned):
    data = paths_to_bytes(learned)
    assert paths_to_bytes(paths_from_bytes(data)) == data


def test_the_largest_map_is_some_hundred_kilobytes(learned):
    rng = np.random.default_rng(0)
    rough = np.log(rng.gamma(2.0, size=(1, 160, 160, 16))) - 9.0  # a map without any empty ground
    flow = replace(
        learned.density,
        log_density=of_levels(to_levels(rough)),
        unseen=np.zeros((160, 160)),
        people=rng.gamma(2.0, size=(160, 160)).astype(np.float32),
    )
    data = paths_to_bytes(replace(learned, density=flow, coverage=coverage_of(flow)))
    assert len(data) < 1_000_000
    assert_array_equal(paths_from_bytes(data).density.log_density, flow.log_density)


@pytest.mark.parametrize("wrong", [b"", b"nothing", b"PK\x03\x04 cut", None])
def test_what_is_no_flow_is_named_so(learned, wrong):
    data = paths_to_bytes(learned)[:-200] if wrong is None else wrong
    with pytest.raises(CheckpointError, match="not readable"):
        paths_from_bytes(data)
