"""A worker that is killed while tracks come grows one map."""

import os
import signal

import pytest
from sqlalchemy import select

from service.store.references import FlowMapRecord
from tests.conftest import CAMERA
from tests.running import wait_for
from tests.service.estimation.test_growth import WANTED, make_street, map_of
from tests.service.street import PRIOR


@pytest.mark.nightly
def test_a_worker_killed_while_tracks_come_grows_one_map(service):
    service.start_again(flow_unsure_tracks=0, window_tracks=40)
    wait_for(service.ready)
    service.http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
    street = make_street(service.http, service.settings)
    street.keep_to_lanes(PRIOR, WANTED)
    wait_for(lambda: street.pose()["reference"]["state"] == "ready")
    street.keep_to_lanes(PRIOR, 200)
    wait_for(lambda: street.pose()["tracks"] == 40)  # stored; the map is learned next
    os.kill(service.worker_pid(), signal.SIGKILL)
    street.keep_to_lanes(PRIOR, 5)
    wait_for(lambda: map_of(street).tracks >= WANTED + 160)
    with street.context.store.read() as session:
        assert len(session.scalars(select(FlowMapRecord)).all()) == 1
