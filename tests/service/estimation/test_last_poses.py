"""Where an estimate begins: at the last one of the camera, at the same site, by any worker."""

from dataclasses import replace

import numpy as np
import pytest

from models.assessment.assess import begin_at
from models.pose import warm_start_from_bytes
from service.estimation.compute import basis_of, begin_of, compute_estimate
from service.estimation.evidence import load_evidence
from service.store.references import LastPoseRecord
from tests.service.street import KNOCKED, PRIOR, known_street


def evidence_of(street):
    with street.context.store.read() as session:
        return load_evidence(session, street.context.settings, "corner")


def begin(evidence):
    return begin_of(evidence, basis_of(evidence))


@pytest.fixture
def laned(http, settings):
    """A street with lanes whose reference is learned."""
    return known_street(http, settings, 100)


def test_the_next_estimate_begins_at_the_last_and_comes_to_the_same(laned):
    laned.keep_to_lanes(PRIOR, 170)
    laned.look()
    laned.keep_to_lanes(PRIOR, 5)
    evidence = replace(evidence_of(laned), asked=True)
    found, full = (compute_estimate(each, 0) for each in (evidence, replace(evidence, last=None)))
    before, after = (warm_start_from_bytes(each.last.data) for each in (evidence, found))
    assert after.search.to_s == before.search.to_s < evidence.tracks[-1].ended_s  # no others tried
    assert warm_start_from_bytes(full.last.data).search.to_s == evidence.tracks[-1].ended_s
    found, full = found.assessment.estimated, full.assessment.estimated
    sd = np.sqrt(np.diag(full.joint.covariance))
    assert (np.abs(found.joint.values - full.joint.values) < 0.05 * sd).all()
    assert found.fused.identifiable == full.fused.identifiable


def test_a_site_that_is_new_or_suspected_begins_anew(known):
    known.walk(PRIOR, 40)
    known.look()
    known.walk(PRIOR, 5)
    evidence = evidence_of(known)
    kept = evidence.last
    at = begin(evidence)
    assert at is not None
    assert begin_at(at, suspicious=False, drifts_slowly=False) is at
    assert begin_at(at, suspicious=True, drifts_slowly=False) is None
    assert begin_at(at, suspicious=False, drifts_slowly=True) is None
    assert begin_at(None, suspicious=False, drifts_slowly=False) is None
    assert begin(replace(evidence, last=None)) is None
    assert begin(replace(evidence, flow=b"grown")) is None
    assert begin(replace(evidence, reference_id=7)) is None
    assert begin(replace(evidence, prior=replace(PRIOR, height_m=7.0))) is None
    other_release = LastPoseRecord(basis=kept.basis, data=b"else")
    assert begin(replace(evidence, last=other_release)) is None


def test_a_changed_camera_begins_anew(known):
    known.walk(PRIOR, 40)
    known.look()
    assert evidence_of(known) is None  # nothing new
    known.walk(KNOCKED, 30)
    assert known.look()["tracks"] < 70  # its window begins at the change
    known.walk(KNOCKED, 5)
    assert evidence_of(known).last is None
