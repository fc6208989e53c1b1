"""A flow reference through bytes and back: what it says hardly changes, and never twice."""

from dataclasses import fields

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from models.errors import CheckpointError
from models.flow.flow_map import FlowMap, coverage_of
from models.flow.packing import flow_from_bytes, flow_to_bytes
from models.flow.reference import FlowReference, learn_flow
from models.flow.rounding import rounded
from tests.models.sites import LENS, PRIOR, seen, tracks_of


@pytest.fixture(scope="module")
def learned():
    (known,) = tracks_of(3, (PRIOR, 60))
    reference = learn_flow(seen(known), LENS, PRIOR, 0)
    assert reference is not None
    return reference


def test_bytes_change_a_log_density_by_less_than_a_hundredth(learned):
    back = flow_from_bytes(flow_to_bytes(learned))
    off = np.abs(back.flow.log_density - learned.flow.log_density)
    assert off.max() < 0.01
    assert_array_equal(back.flow.log_density, rounded(learned.flow.log_density))
    assert_array_equal(back.flow.corner, learned.flow.corner)
    assert (back.flow.cell_m, back.flow.elsewhere) == (learned.flow.cell_m, learned.flow.elsewhere)
    assert_allclose(back.coverage.shares, learned.coverage.shares, rtol=0.01)
    assert_array_equal(back.coverage.places, learned.coverage.places)
    for field in fields(FlowReference):
        if field.name not in ("flow", "coverage"):
            assert_array_equal(getattr(back, field.name), getattr(learned, field.name))
            assert type(getattr(back, field.name)) is type(getattr(learned, field.name))


def test_what_was_rounded_once_comes_back_to_the_bit(learned):
    data = flow_to_bytes(learned)
    assert flow_to_bytes(flow_from_bytes(data)) == data


def test_the_largest_map_is_some_hundred_kilobytes(learned):
    rng = np.random.default_rng(0)
    rough = np.log(rng.gamma(2.0, size=(160, 160, 16))) - 9.0  # a map without any empty ground
    flow = FlowMap(corner=np.zeros(2), cell_m=0.5, log_density=rough, elsewhere=-12.0)
    rest = {
        field.name: getattr(learned, field.name)
        for field in fields(FlowReference)
        if field.name not in ("flow", "coverage")
    }
    data = flow_to_bytes(FlowReference(flow=flow, coverage=coverage_of(flow), **rest))
    assert len(data) < 800_000
    assert np.abs(flow_from_bytes(data).flow.log_density - rough).max() < 0.01


@pytest.mark.parametrize("wrong", [b"", b"nothing", b"PK\x03\x04 cut", None])
def test_what_is_no_flow_is_named_so(learned, wrong):
    data = flow_to_bytes(learned)[:-200] if wrong is None else wrong
    with pytest.raises(CheckpointError, match="not readable"):
        flow_from_bytes(data)
