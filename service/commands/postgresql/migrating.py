"""Bring a PostgreSQL database to the newest revision; one process of all machines at a time."""

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

import alembic.command
from alembic.migration import MigrationContext
from sqlalchemy import Connection, text

from service.data_dir import StartError
from service.job_queue import migrate_engine_tables
from service.notifications.keys import settle_key
from service.settings import Settings
from service.store.engines.failures import telling_of_server
from service.store.engines.postgresql import LOCKS, lock_key, postgresql_engine
from service.store.engines.revisions import alembic_config, known_revisions, require_known

log = logging.getLogger("surefoot.migrate")

_PATIENCE_S, _ASK_S = 300.0, 0.2  # another machine may be at it
_VERSION = 130_000  # the first with 64-bit numbers of transactions


def migrate_server(settings: Settings) -> None:
    """Create or upgrade all tables and see to the key.

    The schema changes in one transaction: where a step fails, none was made.

    Raises:
        StartError: what keeps this database from being used, in one line.
    """
    with telling_of_server(settings.store_url), _locked(settings) as connection:
        _require_fit(connection)
        found = MigrationContext.configure(connection).get_current_revision()
        head = known_revisions()[0]
        require_known(found, "the database")
        connection.commit()
        if found != head:
            alembic.command.upgrade(alembic_config(settings.store_url), "head")
            log.info("migrated", extra={"from": found, "to": head})
        migrate_engine_tables(settings)
        settle_key(settings)


@contextmanager
def _locked(settings: Settings) -> Iterator[Connection]:
    """A connection that holds the lock of migrations; its end lets go of it, however it comes."""
    engine = postgresql_engine(settings.store_url, _PATIENCE_S, 1)
    try:
        with engine.connect() as connection:
            _wait_for_lock(connection)
            yield connection
    finally:
        engine.dispose()


def _wait_for_lock(connection: Connection) -> None:
    """Ask again and again: the job engine makes indexes that wait for whoever waits in a query."""
    ends_s = time.monotonic() + _PATIENCE_S
    locked = text("SELECT pg_try_advisory_lock(:locks, :migrate)")
    while not connection.scalar(locked, {"locks": LOCKS, "migrate": lock_key("migrate/")}):
        connection.rollback()
        if time.monotonic() > ends_s:
            raise StartError(
                f"database: another process has been migrating it for {_PATIENCE_S:g} s; see to "
                "that one, and start again"
            )
        time.sleep(_ASK_S)
    connection.commit()


def _require_fit(connection: Connection) -> None:
    version, encoding = connection.execute(
        text(
            "SELECT current_setting('server_version_num')::int, current_setting('server_encoding')"
        )
    ).one()
    if version < _VERSION:
        raise StartError(f"database: PostgreSQL 13 or newer is needed, got {version // 10_000}")
    if encoding != "UTF8":
        raise StartError(f"database: the encoding UTF8 is needed, got {encoding}; createdb -E UTF8")
