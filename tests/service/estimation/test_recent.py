"""What a worker remembers of a camera's last estimate: a start for the next, at the same site."""

from dataclasses import replace

import numpy as np
import pytest

from service.estimation.evidence import load_evidence
from service.estimation.finding import compute_finding
from service.estimation.recent import Recent
from tests.conftest import CAMERA
from tests.service.street import PRIOR, Street

CALM = {"crept": False, "suspicious": False}


def evidence_of(street):
    with street.context.store.read() as session:
        return load_evidence(session, street.context.settings, "corner")


@pytest.fixture
def laned(http, settings):
    """A street with lanes whose reference is learned."""
    http.post("/cameras", json={**CAMERA, "reference_tracks": 100}).raise_for_status()
    street = Street(http, settings)
    street.keep_to_lanes(PRIOR, 100)
    assert street.look()["reference"]["state"] == "ready"
    return street


def test_the_next_estimate_begins_at_the_last_and_comes_to_the_same(laned):
    laned.keep_to_lanes(PRIOR, 170)
    laned.look()
    laned.keep_to_lanes(PRIOR, 5)
    evidence, recent = evidence_of(laned), laned.context.recent
    before = recent.last(evidence, **CALM)
    found, full = compute_finding(evidence, 0, recent), compute_finding(evidence, 0)
    after = recent.last(evidence, **CALM)
    assert after is not before
    assert after.full.to_s == before.full.to_s < evidence.tracks[-1].ended_s  # no other pose tried
    sd = np.sqrt(np.diag(full.joint.covariance))
    assert (np.abs(found.joint.values - full.joint.values) < 0.05 * sd).all()
    assert found.fused.identifiable == full.fused.identifiable


def test_a_site_that_is_new_or_suspected_begins_anew(known):
    known.walk(PRIOR, 40)
    known.look()
    known.walk(PRIOR, 5)
    evidence, recent = evidence_of(known), known.context.recent
    assert recent.last(evidence, **CALM) is not None
    assert recent.last(evidence, crept=False, suspicious=True) is None
    assert recent.last(replace(evidence, flow=b"grown"), **CALM) is None
    assert recent.last(replace(evidence, reference_id=7), **CALM) is None
    elsewhere = replace(PRIOR, height_m=7.0)
    assert recent.last(replace(evidence, prior=elsewhere), **CALM) is None
    assert recent.last(replace(evidence, camera_id="other"), **CALM) is None


def test_as_many_cameras_are_remembered_as_there_is_room_for(known):
    known.walk(PRIOR, 40)
    evidence = evidence_of(known)
    recent = Recent(most=2)
    cameras = [replace(evidence, camera_id=name) for name in "abc"]
    for camera in cameras:
        compute_finding(camera, 0, recent)
    assert [recent.last(camera, **CALM) is not None for camera in cameras] == [False, True, True]
