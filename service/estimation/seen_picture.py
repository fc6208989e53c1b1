"""The newest image for an estimate, and when a camera is asked for another."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.pose import PictureEvidence, of_agreeing
from models.reasons import Reason
from service.enums import PoseState
from service.reasons import ServiceCode
from service.references import is_before
from service.store import pictures
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.pictures import PictureRecord
from service.store.references import SiteReferenceRecord
from service.store.windows import WindowBounds

_LATER = 0.25  # of the people: so many may have come after a picture that counts beside them
_DOUBTS = (PoseState.SUSPECTED, PoseState.UNSURE, PoseState.DRIFTING)
_AGAIN = timedelta(minutes=1)
INDEPENDENT_S = 60.0  # between images: a guess at how long a lorry waits before a camera


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenPicture:
    """The newest image for an estimate, of a time in seconds since the epoch.

    `raw` is as in `estimates.picture`; `evidence` is by the image and earlier ones that agree with
    it, and None if it matched none of the gallery.
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
    """The newest image that was compared, and those that agree with it, within a window's bounds.

    None if it was taken before a reference, an answer or a change, or during maintenance.
    """
    record = pictures.compared(session, reference.camera_id, reference.prior_pose_id)
    if record is None:
        return None
    answered_at = reference.answered_at
    if answered_at is not None and record.stored_at <= answered_at:
        return None
    answered_s = -math.inf if answered_at is None else answered_at.timestamp()

    def counts(taken_s: float) -> bool:
        attended = any(from_s <= taken_s < to_s for from_s, to_s in bounds.without)
        return not attended and not is_before(taken_s, bounds)

    taken_s = record.same_since.timestamp()
    if not counts(taken_s):
        return None
    earlier = [
        each for each in record.earlier if each["taken_s"] > answered_s and counts(each["taken_s"])
    ]
    return SeenPicture(
        taken_s=taken_s,
        evidence=None if record.offset is None else evidence_of(record, earlier),
        raw=record.as_estimate,
    )


def evidence_of(record: PictureRecord, earlier: Sequence[Mapping[str, Any]]) -> PictureEvidence:
    """The evidence of an image that matched, and of earlier matches, the newest first.

    Images less than a minute after one another share their lorry: one of them counts.
    """
    matches = record.matches[:1]
    for each in earlier:
        if matches[-1]["taken_s"] - each["taken_s"] >= INDEPENDENT_S:
            matches.append(dict(each))
    return of_agreeing(
        [
            PictureEvidence.of_match(
                np.array(each["offset"]), np.array(each["covariance"]), each["inliers"]
            )
            for each in matches
        ]
    )
