"""The start of an estimate: the pose that was found of the camera last, by whichever worker.

Losing it costs a full search, and nothing else.
"""

import hashlib

from sqlalchemy.orm import Session

from models.errors import CheckpointError
from models.pose import WarmStart, warm_start_from_bytes, warm_start_to_bytes
from service.estimation.evidence import Evidence, KeptPose
from service.store.references import LastPoseRecord


def basis_of(evidence: Evidence, *, crept: bool, suspicious: bool) -> bytes:
    """A digest of an estimate's site and of what its chart suspects."""
    parts = (
        evidence.site,
        evidence.flow,
        evidence.anchor.flow if crept and evidence.anchor else b"",
    )
    named = (evidence.reference_id, evidence.intrinsics, evidence.prior, suspicious)
    digest = hashlib.blake2b(repr(named).encode(), digest_size=16)
    for part in parts:
        digest.update(hashlib.blake2b(part or b"", digest_size=16).digest())
    return digest.digest()


def begin_of(kept: KeptPose | None, basis: bytes) -> WarmStart | None:
    """The pose that an estimate may begin at; None where there is none on the same basis.

    One of another release cannot be read: that is as none.
    """
    if kept is None or kept.basis != basis:
        return None
    try:
        return warm_start_from_bytes(kept.data)
    except CheckpointError:
        return None


def kept_of(last: WarmStart | None, basis: bytes) -> KeptPose | None:
    """The pose to be kept for the next estimate, if any."""
    return None if last is None else KeptPose(basis=basis, data=warm_start_to_bytes(last))


def save_last_pose(session: Session, reference_id: int, kept: KeptPose | None) -> None:
    """Keep it in the place of the one before; what is None takes that away."""
    if kept is not None:
        session.merge(LastPoseRecord(reference_id=reference_id, basis=kept.basis, data=kept.data))
    elif (record := session.get(LastPoseRecord, reference_id)) is not None:
        session.delete(record)
