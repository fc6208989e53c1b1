"""What a worker found last of each camera, in its memory: the next estimate begins there.

Another worker, or this one after a restart, makes a full search instead: losing it costs time, and
nothing else. A finding is some kilobytes.
"""

import hashlib
import threading
from collections import OrderedDict
from dataclasses import replace

from models.recalibration import PoseFinding
from service.estimation.evidence import Evidence

_MOST = 5000  # cameras


class Recent:
    """The newest finding of each camera, as long as all else that it hangs on is the same."""

    def __init__(self, most: int = _MOST) -> None:
        self._most = most
        self._kept: OrderedDict[str, tuple[bytes, PoseFinding]] = OrderedDict()
        self._lock = threading.Lock()

    def last(self, evidence: Evidence, *, crept: bool, suspicious: bool) -> PoseFinding | None:
        """Where an estimate may begin; None where the site or what the chart says is new."""
        with self._lock:
            known, last = self._kept.get(evidence.camera_id, (b"", None))
        return (
            last if last is None or known == _circumstances(evidence, crept, suspicious) else None
        )

    def keep(
        self, evidence: Evidence, finding: PoseFinding, *, crept: bool, suspicious: bool
    ) -> None:
        """Remember a finding in the place of the one before; the longest unused goes for it."""
        # A second look and failures, whose frames would be kept with them, are of no use later.
        last = replace(finding, earlier=None, lacks=())
        with self._lock:
            self._kept.pop(evidence.camera_id, None)
            if finding.full is not None and not finding.lacks:
                self._kept[evidence.camera_id] = (
                    _circumstances(evidence, crept, suspicious),
                    last,
                )
            while len(self._kept) > self._most:
                self._kept.popitem(last=False)


def _circumstances(evidence: Evidence, crept: bool, suspicious: bool) -> bytes:
    """What tells the site of an estimate, and what its chart suspects, from any other."""
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
