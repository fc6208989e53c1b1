"""Records of the store. Angles are radians, times aware UTC; track times seconds since epoch."""

from typing import Any

from sqlalchemy import ForeignKey
from sqlalchemy.orm import mapped_column


def camera_key() -> Any:
    """A column of the camera that a row is of, and goes with."""
    return mapped_column(ForeignKey("cameras.id", ondelete="CASCADE"))


def foreign_key(target: str, gone: str = "CASCADE", **options: Any) -> Any:
    """A column that names a row elsewhere, and what becomes of it with that."""
    return mapped_column(ForeignKey(target, ondelete=gone), **options)
