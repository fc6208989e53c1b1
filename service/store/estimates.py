"""Estimates: the history of the served pose."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import JSON, ColumnElement, Index, bindparam, delete, func, select
from sqlalchemy.orm import Mapped, Session, composite, mapped_column

from models.geometry.pose import FIELDS, PoseParameters
from models.monitoring.drift import Drift, MoveProbabilities
from service.enums import PoseState
from service.reasons import Reasons
from service.store.engines.dialects import as_json
from service.store.record import (
    Record,
    camera_key,
    count_where,
    delete_some,
    foreign_key,
    newest_first,
    one_of,
    surplus,
    vocabulary,
)


def _parameters(*columns: str) -> Any:
    """Four columns as one value; a heading that was never known is 0 and not identifiable."""
    return composite(_as_parameters, *columns)


def _as_parameters(
    height_m: float, tilt_rad: float, roll_rad: float, heading_rad: float | None
) -> PoseParameters:
    return PoseParameters(
        height_m=height_m, tilt_rad=tilt_rad, roll_rad=roll_rad, heading_rad=heading_rad or 0.0
    )


# States of cameras without an estimate to say so.
_OF_CAMERAS = (PoseState.UNCONNECTED, PoseState.UNCALIBRATED, PoseState.NO_DATA)


class EstimateRecord(Record):
    """The served pose at one time, and what is behind it.

    `pose` is the served one: the prior's where the tracks leave it open. `drift_by` and `pose_sd`
    are the estimator's for all four parameters; `identifiable` names those that count.
    `raw` has each estimator's own answer. `model_id` is of the averaged estimate beside the served
    one.
    """

    __tablename__ = "estimates"

    id: Mapped[int] = mapped_column(primary_key=True)
    camera_id: Mapped[str] = camera_key()
    model_id: Mapped[str | None] = foreign_key("models.id", "SET NULL", index=True)
    prior_pose_id: Mapped[int] = foreign_key("prior_poses.id", index=True)
    reference_id: Mapped[int | None] = foreign_key("site_references.id", index=True)
    state: Mapped[PoseState] = mapped_column(vocabulary(PoseState, checked=False))
    reasons: Mapped[Reasons]
    identifiable: Mapped[list[str]] = mapped_column("told")  # of tilt, roll, height, heading
    height_m: Mapped[float]
    tilt_rad: Mapped[float]
    roll_rad: Mapped[float]
    heading_rad: Mapped[float]
    height_sd_m: Mapped[float]
    tilt_sd_rad: Mapped[float]
    roll_sd_rad: Mapped[float]
    heading_sd_rad: Mapped[float | None]
    covariance: Mapped[list[Any]] = mapped_column(JSON)  # of tilt, roll, log height, heading
    drift_height_m: Mapped[float]
    drift_tilt_rad: Mapped[float]
    drift_roll_rad: Mapped[float]
    drift_heading_rad: Mapped[float]
    drift_angle_rad: Mapped[float]
    moved: Mapped[float]  # the probability that it did
    moved_parameters: Mapped[dict[str, Any]]  # and that each parameter changed
    alternatives: Mapped[list[Any]] = mapped_column(JSON)  # other poses that explain the tracks
    detectable: Mapped[dict[str, Any]]  # by parameter, of 60, 250, 800 people
    suspected: Mapped[bool]  # the score test says that the camera has moved
    drift_streak: Mapped[int]  # 1: beyond the limits; -1: below the share that clears
    drifted: Mapped[list[str]]  # of those: what has been beyond since it began
    drift_after: Mapped[datetime | None]  # it stood where it should, before it moved
    drift_since: Mapped[datetime | None]  # it had moved at the latest
    raw: Mapped[dict[str, Any]]
    tracks: Mapped[int]
    from_s: Mapped[float]
    to_s: Mapped[float]
    newest_track_pk: Mapped[int]
    created_at: Mapped[datetime]
    pose: Mapped[PoseParameters] = _parameters("height_m", "tilt_rad", "roll_rad", "heading_rad")
    pose_sd: Mapped[PoseParameters] = _parameters(
        "height_sd_m", "tilt_sd_rad", "roll_sd_rad", "heading_sd_rad"
    )
    drift_by: Mapped[PoseParameters] = _parameters(
        "drift_height_m", "drift_tilt_rad", "drift_roll_rad", "drift_heading_rad"
    )

    __table_args__ = (
        # That nobody comes is no estimate's to say.
        one_of("state", [state for state in PoseState if state not in _OF_CAMERAS]),
        Index(None, "camera_id", "id"),
    )

    @property
    def suspects_move(self) -> bool:
        """True where its camera may have moved: it is looked at before others, its map stays."""
        return self.suspected or self.drift_streak > 0 or bool(self.drifted)

    @property
    def drift(self) -> Drift:
        """The drift against the prior pose, and which of it is identifiable."""
        return Drift(
            by=self.drift_by,
            sd=self.pose_sd,
            angle_rad=self.drift_angle_rad,
            identifiable=tuple(self.identifiable),
            move=MoveProbabilities(moved=self.moved, parameters=self.moved_parameters),
        )


# Built once: a post of tracks asks for it.
_NEWEST = newest_first(EstimateRecord, bindparam("camera")).limit(1)


def newest(session: Session, camera_id: str) -> EstimateRecord | None:
    """The estimate that is served, or None."""
    return session.scalars(_NEWEST, {"camera": camera_id}).first()


def newest_of_earlier(session: Session, camera_id: str, reference_id: int) -> EstimateRecord | None:
    """The last estimate under an earlier reference, or None."""
    query = newest_first(EstimateRecord, camera_id)
    return session.scalars(query.where(EstimateRecord.reference_id < reference_id).limit(1)).first()


def last_at(
    session: Session, camera_id: str, prior_pose_id: int, at_s: float, *, drifting: bool
) -> EstimateRecord | None:
    """The last estimate of people before a time, in state `drifting` or in another; or None."""
    state = EstimateRecord.state
    query = newest_first(EstimateRecord, camera_id).where(
        EstimateRecord.prior_pose_id == prior_pose_id,
        state == PoseState.DRIFTING if drifting else state != PoseState.DRIFTING,
        EstimateRecord.from_s <= at_s,
    )
    return session.scalars(query.limit(1)).first()


def of_drift(
    session: Session,
    camera_id: str,
    moved_s: float | None,
    until: datetime | None,
    at_s: float,
) -> EstimateRecord | None:
    """The estimate that says best where a camera stood at a time of a drift; None where none does.

    The newest of those whose people had begun to come by then, and if none had, the first.

    The drift began at `moved_s` of the tracks' time, where that is known, and was over at `until`,
    None while it lasts.
    """
    conditions = [
        EstimateRecord.camera_id == camera_id,
        EstimateRecord.state == PoseState.DRIFTING,
        as_json(EstimateRecord.identifiable) != "[]",
    ]
    if moved_s is not None:
        conditions.append(EstimateRecord.to_s >= moved_s)
    if until is not None:
        conditions.append(EstimateRecord.created_at <= until)
    query = select(EstimateRecord).where(*conditions)
    known = query.where(EstimateRecord.from_s <= at_s).order_by(EstimateRecord.id.desc())
    found = session.scalars(known.limit(1)).first()
    return found or session.scalars(query.order_by(EstimateRecord.id).limit(1)).first()


def between(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, limit: int
) -> Sequence[EstimateRecord]:
    """The newest so many estimates made between two times, oldest first."""
    query = select(EstimateRecord).where(*_made_between(camera_id, start, end))
    return session.scalars(query.order_by(EstimateRecord.id.desc()).limit(limit)).all()[::-1]


def thinned(
    session: Session, camera_id: str, start: datetime | None, end: datetime | None, most: int
) -> Sequence[EstimateRecord]:
    """Every so many-th of the estimates made between two times, oldest first; the newest is one."""
    wanted = _made_between(camera_id, start, end)
    count = count_where(session, *wanted)
    number = func.row_number().over(order_by=EstimateRecord.id.desc()).label("number")
    numbered = select(EstimateRecord.id, number).where(*wanted).subquery()
    every = max(-(-count // most), 1)
    kept = select(numbered.c.id).where((numbered.c.number - 1) % every == 0)
    query = select(EstimateRecord).where(EstimateRecord.id.in_(kept)).order_by(EstimateRecord.id)
    return session.scalars(query).all()


def forget(session: Session, camera_id: str, keep: int, limit: int) -> int:
    """Delete up to `limit` of all but the newest so many, oldest first. Returns how many."""
    beyond = surplus(EstimateRecord, camera_id, keep).subquery()
    bite = select(beyond.c.id).order_by(beyond.c.id).limit(limit)
    return delete_some(session, EstimateRecord.id, bite)


def _made_between(
    camera_id: str, start: datetime | None, end: datetime | None
) -> list[ColumnElement[bool]]:
    conditions: list[ColumnElement[bool]] = [EstimateRecord.camera_id == camera_id]
    if start is not None:
        conditions.append(EstimateRecord.created_at >= start)
    if end is not None:
        conditions.append(EstimateRecord.created_at <= end)
    return conditions


def identifiable_drift(drift: Drift) -> dict[str, float | None]:
    """The identifiable drift as an alert keeps it; None where the tracks leave it open."""
    angle_rad = drift.angle_rad if drift.has_angle else None
    return {**_where_identifiable(drift.by, drift.identifiable), "angle_rad": angle_rad}


def identifiable_sd(drift: Drift) -> dict[str, float | None]:
    """The standard deviations of what is identifiable, likewise."""
    return _where_identifiable(drift.sd, drift.identifiable)


def _where_identifiable(
    parameters: PoseParameters, identifiable: tuple[str, ...]
) -> dict[str, float | None]:
    names = ("height", "tilt", "roll", "heading")
    return {FIELDS[n]: parameters.of(n) if n in identifiable else None for n in names}


def forget_later(session: Session, camera_id: str, estimate_id: int) -> None:
    """Delete the estimates of a camera that were made after one."""
    session.execute(
        delete(EstimateRecord).where(
            EstimateRecord.camera_id == camera_id, EstimateRecord.id > estimate_id
        )
    )
