"""Records of the store: what all tables share.

Angles are radians, times aware UTC; times of tracks are seconds since the epoch.
"""

from collections.abc import Iterable
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any, ClassVar, TypeVar

from sqlalchemy import (
    JSON,
    BigInteger,
    CheckConstraint,
    ColumnElement,
    DateTime,
    Dialect,
    Enum,
    ForeignKey,
    Integer,
    MetaData,
    Select,
    TypeDecorator,
    delete,
    func,
    select,
)
from sqlalchemy.orm import DeclarativeBase, InstrumentedAttribute, Session, mapped_column

from models.geometry.intrinsics import Projection
from service import enums
from service.reasons import Reasons, from_json, to_json

Found = TypeVar("Found")
NAMING = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}
# Vocabularies by the column that has their words, in whichever table.
_STORED: dict[type[StrEnum], str] = {
    enums.Activity: "what",
    enums.AlertKind: "kind",
    enums.AlertSource: "source",
    enums.AlertState: "state",
    enums.Answer: "answer",
    enums.DeliveryState: "state",
    enums.EventType: "type",
    enums.MessageType: "type",
    enums.Origin: "origin",
    enums.Outcome: "outcome",
    enums.PoseState: "state",
    Projection: "projection",
    enums.RunKind: "kind",
    enums.Severity: "severity",
    enums.TrainingState: "state",
    enums.WebhookFormat: "format",
}


class UtcDateTime(TypeDecorator[datetime]):
    """Aware UTC times; SQLite keeps them without their zone."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Refuse naive times; store UTC."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"time: an aware time is needed, got {value}")
        return value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Give the zone back."""
        return None if value is None else value.replace(tzinfo=UTC)


class ReasonsJson(TypeDecorator[Reasons]):
    """Reasons, as JSON."""

    impl = JSON
    cache_ok = True

    def process_bind_param(self, value: Reasons | None, dialect: Dialect) -> Any:
        """A list of codes with their values."""
        return None if value is None else to_json(value)

    def process_result_value(self, value: Any, dialect: Dialect) -> Reasons | None:
        """The reasons."""
        return None if value is None else from_json(value)


def vocabulary(words: type[StrEnum], *, checked: bool = True) -> Enum:
    """The type of a column of words; `checked` has the store refuse any other."""
    return Enum(
        words,
        name=_STORED[words],
        native_enum=False,
        create_constraint=checked,
        length=None,
        values_callable=lambda members: [member.value for member in members],
    )


def one_of(column: str, words: Iterable[StrEnum]) -> CheckConstraint:
    """The constraint of a column that has some words alone of its vocabulary."""
    listed = ", ".join(f"'{word}'" for word in words)
    return CheckConstraint(f"{column} IN ({listed})", name=column)


class Record(DeclarativeBase):
    """Base of all records."""

    metadata = MetaData(naming_convention=NAMING)
    type_annotation_map: ClassVar[dict[Any, Any]] = {
        datetime: UtcDateTime,
        # SQLite's integers have as many bytes as they need, PostgreSQL's as they are said to.
        int: BigInteger().with_variant(Integer, "sqlite"),
        dict[str, Any]: JSON,
        list[float]: JSON,
        list[str]: JSON,
        Reasons: ReasonsJson(),
    }
    type_annotation_map |= {words: vocabulary(words) for words in _STORED}


def camera_key() -> Any:
    """A column of the camera that a row is of, and goes with."""
    return mapped_column(ForeignKey("cameras.id", ondelete="CASCADE"))


def foreign_key(target: str, gone: str = "CASCADE", **options: Any) -> Any:
    """A column that names a row elsewhere, and what becomes of it with that."""
    return mapped_column(ForeignKey(target, ondelete=gone), **options)


def newest_first(record: type[Found], camera_id: Any, by: Any = None) -> Select[Found]:
    """The rows of a camera, newest first: by their ids, or by another column."""
    table: Any = record
    order = table.id if by is None else by
    return select(record).where(table.camera_id == camera_id).order_by(order.desc())


def surplus(record: Any, camera_id: str, keep: int, by: Any = None) -> Select[Any]:
    """The ids of all but the newest so many rows of a camera."""
    return newest_first(record, camera_id, by).with_only_columns(record.id).offset(keep)


def count_where(session: Session, *conditions: ColumnElement[bool]) -> int:
    """The number of rows that meet some conditions."""
    return session.scalar(select(func.count()).where(*conditions)) or 0


def delete_some(session: Session, key: InstrumentedAttribute[Any], some: Select[Any]) -> int:
    """Delete the rows whose keys a query gives; how many. It may give none: nothing is written."""
    keys = session.scalars(some).all()
    if keys:
        session.execute(delete(key.class_).where(key.in_(keys)))
    return len(keys)
