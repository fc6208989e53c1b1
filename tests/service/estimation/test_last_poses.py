"""Where an estimate begins: at the last one of the camera, at the same site, by any worker."""

from dataclasses import replace

import numpy as np
import pytest
from service.estimation.finding import basis_of, begin_of, compute_finding

from models.pose import warm_start_from_bytes
from service.estimation.evidence import load_evidence
from service.store.references import LastPoseRecord
from tests.service.street import KNOCKED, PRIOR, known_street


def evidence_of(street):
    with street.context.store.read() as session:
        return load_evidence(session, street.context.settings, "corner")


@pytest.fixture
def laned(http, settings):
    """A street with lanes whose reference is learned."""
    return known_street(http, settings, 100)


def test_the_next_estimate_begins_at_the_last_and_comes_to_the_same(laned):
    laned.keep_to_lanes(PRIOR, 170)
    laned.look()
    laned.keep_to_lanes(PRIOR, 5)
    evidence = evidence_of(laned)
    found, full = compute_finding(evidence, 0), compute_finding(replace(evidence, last=None), 0)
    before, after = (warm_start_from_bytes(each.last.data) for each in (evidence, found))
    assert after.search.to_s == before.search.to_s < evidence.tracks[-1].ended_s  # no others tried
    assert warm_start_from_bytes(full.last.data).search.to_s == evidence.tracks[-1].ended_s
    sd = np.sqrt(np.diag(full.joint.covariance))
    assert (np.abs(found.joint.values - full.joint.values) < 0.05 * sd).all()
    assert found.fused.identifiable == full.fused.identifiable


def begun(evidence, kept, *, suspicious=False):
    """Where an estimate begins that is made of some evidence; None if it looks at all poses."""
    return begin_of(kept, basis_of(evidence, crept=False, suspicious=suspicious))


def test_a_site_that_is_new_or_suspected_begins_anew(known):
    known.walk(PRIOR, 40)
    known.look()
    known.walk(PRIOR, 5)
    evidence = evidence_of(known)
    kept = evidence.last
    assert begun(evidence, kept) is not None
    assert begun(evidence, None) is None
    assert begun(evidence, kept, suspicious=True) is None
    assert begun(replace(evidence, flow=b"grown"), kept) is None
    assert begun(replace(evidence, reference_id=7), kept) is None
    assert begun(replace(evidence, prior=replace(PRIOR, height_m=7.0)), kept) is None
    # By another release, say.
    assert begun(evidence, LastPoseRecord(basis=kept.basis, data=b"else")) is None


def test_a_changed_camera_begins_anew(known):
    known.walk(PRIOR, 40)
    known.look()
    assert evidence_of(known) is None  # nothing new
    known.walk(KNOCKED, 30)
    assert known.look()["tracks"] < 70  # its window begins at the change
    known.walk(KNOCKED, 5)
    assert evidence_of(known).last is None
