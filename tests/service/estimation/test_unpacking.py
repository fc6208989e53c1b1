"""A refresh unpacks each track once: what it counts are the real calls, on a real database."""

import sys

import pytest

from service.store import references
from service.store.references import FlowMapRecord
from service.store.tracks import unpack
from service.workers.estimate import run_estimate
from tests.conftest import CAMERA
from tests.service.street import PRIOR, Street

WANTED = 60


@pytest.fixture
def unpackings():
    """The bytes of each call of `unpack`, as the interpreter tells of them."""
    found: list[bytes] = []

    def note(frame, event, _):
        if event == "call" and frame.f_code is unpack.__code__:
            found.append(frame.f_locals["data"])

    sys.setprofile(note)
    yield found
    sys.setprofile(None)


@pytest.mark.parametrize("form", ["points", "boxes"])
def test_each_track_of_a_refresh_is_unpacked_once(http, settings, unpackings, form):
    http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
    street = Street(
        http, settings.model_copy(update={"flow_unsure_tracks": 0, "window_tracks": 40})
    )
    street.walk(PRIOR, WANTED, form=form)
    street.walk(PRIOR, 90, form=form)  # the map grows with the same look
    unpackings.clear()
    run_estimate(street.context, "corner")
    each = 1 if form == "points" else 2
    assert len(unpackings) == each * (WANTED + 90)
    assert len(set(unpackings)) == len(unpackings)
    assert street.pose()["tracks"] == 40
    with street.context.store.read() as session:
        grown = session.get(FlowMapRecord, references.newest(session, "corner").id)
    assert grown.tracks == WANTED + 50  # all but the window
    street.walk(PRIOR, 5, form=form)
    unpackings.clear()
    run_estimate(street.context, "corner")
    assert len(unpackings) == each * 40  # the window; the map has nothing to grow by
