"""The newest picture of a camera against its gallery: how far it has turned, what is wrong with it.

Three steps, as of an estimate: read in one transaction, computed in none, saved in another.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
from sqlalchemy.orm import Session

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.monitoring.drift import LIKELY
from models.pictures import (
    Features,
    PictureFault,
    Turn,
    best_turn,
    bridged,
    describe_jpeg,
    judge,
    read_gallery,
    renewed,
    turned_covariance,
    turned_pose,
)
from models.pose import drift_by_images, posterior_by_picture, turn_by_pose
from models.reasons import Reason
from service.alerts.alerts import end_alert, open_alert
from service.enums import AlertKind, AlertSource, Outcome, Severity
from service.estimation.seen_picture import INDEPENDENT_S, evidence_of
from service.reasons import ServiceCode
from service.references import drift_limits
from service.settings import Settings
from service.store import alerts, cameras, pictures, references
from service.store.cameras import CameraRecord, SnapshotRecord
from service.store.pictures import PictureRecord, PictureReferenceRecord

_MOST_EARLIER = 7  # matches kept beside the newest: with 8 that agree, their common error is most


@dataclass(frozen=True, slots=True, kw_only=True)
class NewPicture:
    """A picture that nobody has looked at, and what it is compared with.

    Where the camera may not stand at its prior pose, or somebody is there, it begins no gallery.
    """

    snapshot: SnapshotRecord
    intrinsics: Intrinsics
    prior_pose_id: int
    prior: CameraPose
    gallery: tuple[tuple[int, Features], ...]
    last: PictureRecord | None
    unmatched: Features | None
    may_begin: bool
    limits_rad: float
    moved_prior: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedPicture:
    """What a picture tells. `kept` of the gallery stay, and the `added` joins them."""

    record: PictureRecord
    fault: PictureFault | None
    kept: tuple[int, ...]
    added: tuple[Features, ...]


def load_picture(session: Session, settings: Settings, camera_id: str) -> NewPicture | None:
    """The picture of a camera that waits to be compared; None where there is none."""
    snapshot = cameras.waiting_snapshot(session, camera_id)
    camera = session.get(CameraRecord, camera_id)
    if snapshot is None or camera is None:
        return None
    prior = cameras.prior_pose(session, camera_id)
    if prior.assumed:
        return None
    now = datetime.now(UTC)
    doubted = alerts.pose_doubted(session, camera_id)
    attended = references.maintenance_under_way(session, camera_id, now) is not None
    kept = pictures.gallery(session, prior.id)
    ids, gallery = [each.id for each in kept], read_gallery([each.features for each in kept])
    unmatched = pictures.unmatched(session, camera_id)
    return NewPicture(
        snapshot=snapshot,
        intrinsics=camera.intrinsics,
        prior_pose_id=prior.id,
        prior=prior.pose,
        gallery=tuple(zip(ids, gallery, strict=False)),  # none of it, or all
        last=session.get(PictureRecord, camera_id),
        unmatched=next(iter(read_gallery([unmatched] if unmatched else [])), None),
        may_begin=not (doubted or attended),
        limits_rad=drift_limits(settings).floor_rad,
        moved_prior=settings.moved_prior,
    )


def compare(new: NewPicture) -> ComparedPicture:
    """Compare a picture with the gallery."""
    now = describe_jpeg(new.snapshot.jpeg)
    references_ = [features for _, features in new.gallery]
    turn = best_turn(references_, now, new.intrinsics).turn
    last = new.last if new.last and new.last.prior_pose_id == new.prior_pose_id else None
    record = _result(new, now, turn, last)
    fault = judge(
        now.measures,
        [each.measures for each in references_],
        unchanged_s=record.unchanged_s,
        matched=turn is not None,
    )
    after: Sequence[Features] = references_
    if fault is None and (references_ or new.may_begin):
        after = renewed(references_, now, turn)
        if after and not references_:
            record.has_moved = False  # where it stands is where all others are turned from
    stands = record.has_moved is False and last is not None and last.has_moved is False
    if turn is not None and stands and new.unmatched is not None:
        after = bridged(after, new.unmatched, turn)
    waits = turn is None and fault is None and stands and bool(references_)
    record.unmatched = now.to_bytes() if waits else None
    same = {id(each) for each in after}
    return ComparedPicture(
        record=record,
        fault=fault,
        kept=tuple(at for at, each in new.gallery if id(each) in same),
        added=tuple(each for each in after if all(each is not old for old in references_)),
    )


def _result(
    new: NewPicture, now: Features, turn: Turn | None, last: PictureRecord | None
) -> PictureRecord:
    """The record of a picture; of one that begins a gallery, there is nothing to tell."""
    snapshot, digest = new.snapshot, now.measures.digest
    same = last is not None and last.digest == digest
    record = PictureRecord(
        camera_id=snapshot.camera_id,
        prior_pose_id=new.prior_pose_id,
        taken_at=snapshot.taken_at,
        stored_at=snapshot.stored_at,
        digest=digest,
        same_since=last.same_since if same and last else snapshot.taken_at,
        # What is not named here stays in the store as it was, and would be the one's before.
        **dict.fromkeys(("offset", "covariance", "zoom", "zoom_sd")),
        shifted=turn is not None and turn.shifted,
        has_moved=None if last is None else last.has_moved,
        agreement={} if new.last is None else new.last.agreement,
        other_at=None if last is None else last.other_at,
        inliers=None,
        compared=(0 if last is None else last.compared) + bool(new.gallery),
        earlier=[] if last is None else _earlier(last, digest),
    )
    if turn is None:
        return record
    record.offset = turn_by_pose(new.prior, turned_pose(new.prior, turn)).tolist()
    record.covariance = turned_covariance(new.prior, turn).tolist()
    record.inliers = turn.inliers
    record.zoom = float(np.exp(turn.log_zoom))
    record.zoom_sd = record.zoom * float(np.sqrt(turn.covariance[3, 3]))
    evidence = evidence_of(record, record.earlier)
    posterior = posterior_by_picture(new.prior, evidence, new.moved_prior)
    has_moved = posterior.moved >= LIKELY
    if has_moved and drift_by_images(posterior).angle_rad < new.limits_rad:
        return record  # so little may be the light's
    if last is not None and last.has_moved is not None and last.has_moved != has_moved:
        record.other_at = last.taken_at
    record.has_moved = has_moved
    return record


def _earlier(last: PictureRecord, digest: str) -> list[Any]:
    """The matches to keep beside a new image of a digest of pixels: the newest, a minute apart."""
    if last.digest == digest:
        return last.earlier
    kept = last.matches
    if len(kept) > 1 and kept[0]["taken_s"] - kept[1]["taken_s"] < INDEPENDENT_S:
        return last.earlier
    return kept[:_MOST_EARLIER]


def save_picture(
    session: Session, settings: Settings, new: NewPicture, compared: ComparedPicture
) -> bool:
    """Keep what a picture tells, and its alert; False where another one has come meanwhile.

    Where features alone are kept, the picture goes.
    """
    camera_id = new.snapshot.camera_id
    snapshot = cameras.image_facts(session, SnapshotRecord, camera_id)
    newer = snapshot is None or snapshot.sha256 != new.snapshot.sha256
    if newer or cameras.prior_pose(session, camera_id).id != new.prior_pose_id:
        return False
    if settings.snapshots == "features":
        session.delete(snapshot)
    elif snapshot is not None:
        snapshot.compared_at = datetime.now(UTC)
    pictures.keep_only(session, camera_id, compared.kept)
    for features in compared.added:
        session.add(
            PictureReferenceRecord(
                camera_id=camera_id,
                prior_pose_id=new.prior_pose_id,
                features=features.to_bytes(),
            )
        )
    _cut_window(session, camera_id, new.last, compared.record)
    record = session.merge(compared.record)
    if settings.snapshots == "pictures" and record.has_moved is False:
        record.stood_jpeg, record.stood_at = new.snapshot.jpeg, record.taken_at
    _tell_fault(session, settings, camera_id, compared)
    return True


def _cut_window(
    session: Session, camera_id: str, last: PictureRecord | None, record: PictureRecord
) -> None:
    """Judge a camera that was turned between two pictures by whoever comes after the first."""
    reference = references.newest_if_any(session, camera_id)
    turned = last is not None and record.other_at is not None and record.other_at != last.other_at
    if not turned or record.other_at is None or reference is None or reference.ready_at is None:
        return
    before_s = record.other_at.timestamp()
    if before_s <= (reference.window_from_s or 0.0):
        return
    reference.window_from_s = before_s
    moved = bool(record.has_moved)
    reference.changed_after_s = before_s if moved else None
    reference.changed_s = record.taken_at.timestamp() if moved else None


def _tell_fault(
    session: Session, settings: Settings, camera_id: str, compared: ComparedPicture
) -> None:
    fault, record = compared.fault, compared.record
    if fault is None:
        end_alert(session, camera_id, AlertKind.PICTURE, Outcome.CLEARED)
        return
    values = {"unchanged_s": record.unchanged_s} if fault is PictureFault.FROZEN else {}
    open_alert(
        session,
        settings,
        camera_id,
        AlertKind.PICTURE,
        Severity.WARNING,
        {},
        record.same_since if fault is PictureFault.FROZEN else record.taken_at,
        reasons=(Reason(code=ServiceCode(f"picture_{fault.value}"), values=values),),
        source=AlertSource.PICTURE,
    )
