"""Statements that a process compiles once, and not once a test's database: a quarter of its CPU."""

from functools import partial
from typing import Any

from sqlalchemy import create_engine
from sqlalchemy.dialects.postgresql.psycopg import PGDialect_psycopg
from sqlalchemy.dialects.sqlite.pysqlite import SQLiteDialect_pysqlite
from sqlalchemy.util import LRUCache

from service.store.engines import postgresql, sqlite


def share_statements() -> None:
    """Let every engine of this process find what another one compiled: their dialects are alike."""
    compiled: LRUCache[Any, Any] = LRUCache(5000)
    shared = partial(create_engine, execution_options={"compiled_cache": compiled})
    for engines in (sqlite, postgresql):
        engines.create_engine = shared
    for dialect in (SQLiteDialect_pysqlite, PGDialect_psycopg):
        dialect.__eq__ = lambda self, other: type(self) is type(other)
        dialect.__hash__ = lambda self: hash(type(self))
