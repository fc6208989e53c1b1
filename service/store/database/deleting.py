"""Deleting some rows of many."""

from typing import Any

from sqlalchemy import Select, delete
from sqlalchemy.orm import InstrumentedAttribute, Session


def delete_some(session: Session, key: InstrumentedAttribute[Any], some: Select[Any]) -> int:
    """Delete the rows whose keys a query gives; how many. Where it gives none, nothing is written.

    Args:
        session: of a store.
        key: the column of the primary key.
        some: the query, of some hundreds of keys at most.
    """
    keys = session.scalars(some).all()
    if keys:
        session.execute(delete(key.class_).where(key.in_(keys)))
    return len(keys)
