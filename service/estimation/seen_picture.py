"""What the newest picture says for an estimate, and when a camera is asked for another."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.geometry.pose import ANGLES
from models.pose import PictureEvidence
from models.reasons import Reason
from service.enums import PoseState
from service.reasons import ServiceCode
from service.references import is_before
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.pictures import PictureRecord
from service.store.references import SiteReferenceRecord
from service.store.windows import WindowBounds

_LATER = 0.25  # of the people: so many may have come after a picture that counts beside them
_DOUBTS = (PoseState.SUSPECTED, PoseState.UNSURE, PoseState.DRIFTING)
_AGAIN = timedelta(minutes=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenPicture:
    """What the newest picture says for an estimate: of a time, in seconds since the epoch.

    `raw` is what is told of it, `evidence` None where it matched none of the gallery.
    """

    taken_s: float
    evidence: PictureEvidence | None
    raw: dict[str, Any]

    def counts(self, ended_s: Sequence[float]) -> bool:
        """True where it is new enough beside people whose walks ended at such times.

        Of a quarter of them nothing can have moved since that people would tell; of more, a knock
        after it would wait for the next picture.
        """
        later = sum(each > self.taken_s for each in ended_s)
        return self.evidence is not None and later <= _LATER * len(ended_s)

    @property
    def reason(self) -> Reason | None:
        """The reason for a wider interval of what it says."""
        return Reason(code=ServiceCode.PICTURE_SHIFTED) if self.raw.get("shifted") else None

    def was_told(self, last: EstimateRecord | None) -> bool:
        """True where an estimate has had its word."""
        told = {} if last is None else last.raw.get("picture") or {}
        return bool(told.get("taken_at") == self.raw["taken_at"])


def ask_in_doubt(session: Session, record: EstimateRecord, picture: SeenPicture | None) -> None:
    """Ask the camera for a picture at once where people raise a doubt that none has spoken to."""
    camera = session.get(CameraRecord, record.camera_id)
    if camera is None or camera.snapshot_url is None or record.state not in _DOUBTS:
        return
    now = datetime.now(UTC)
    asked_s = 0.0 if picture is None else picture.taken_s
    spoken = asked_s >= record.to_s or now.timestamp() - asked_s < _AGAIN.total_seconds()
    if not spoken and camera.snapshot_error is None:
        camera.snapshot_due_at = now


def seen_picture(
    session: Session, reference: SiteReferenceRecord, bounds: WindowBounds
) -> SeenPicture | None:
    """The newest picture that was compared, where it is of now: within the bounds of the window.

    None where it is of before a reference, an answer or a change, or somebody was at the camera.
    """
    record = session.get(PictureRecord, reference.camera_id)
    if record is None or record.prior_pose_id != reference.prior_pose_id:
        return None
    if reference.answered_at is not None and record.stored_at <= reference.answered_at:
        return None
    # One that comes again, to the last pixel, is of when it was first seen: a camera's pictures
    # freeze, and would say for ever that it stands.
    taken_s = record.same_since.timestamp()
    attended = any(from_s <= taken_s < to_s for from_s, to_s in bounds.without)
    if attended or is_before(taken_s, bounds):
        return None
    evidence = None
    if record.offset is not None and record.covariance is not None:
        evidence = PictureEvidence(
            offset=np.array(record.offset), covariance=np.array(record.covariance)
        )
    return SeenPicture(taken_s=taken_s, evidence=evidence, raw=_raw(record))


def _raw(record: PictureRecord) -> dict[str, Any]:
    found: dict[str, Any] = {
        "taken_at": record.same_since.isoformat(),
        "matched": record.offset is not None,
    }
    if record.offset is not None and record.covariance is not None:
        sd = np.sqrt(np.diag(np.array(record.covariance))).tolist()
        names = [f"{name}_rad" for name in ANGLES]
        found |= dict(zip(names, record.offset, strict=True))
        found["zoom"] = record.zoom
        found["shifted"] = record.shifted
        found["sd"] = dict(zip(names, sd, strict=True)) | {"zoom": record.zoom_sd}
    return found
