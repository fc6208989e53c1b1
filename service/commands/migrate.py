"""Bring the database to the newest revision: the SQLite file of a data directory, or a server's."""

import fcntl
import logging
from datetime import UTC, datetime
from pathlib import Path

from service.data_dir import (
    COPIES,
    MIGRATE_LOCK,
    StartError,
    make_file,
    make_private,
    require_space,
    sync_folder,
    telling_of,
)
from service.job_queue import migrate_engine_tables
from service.notifications.keys import settle_key
from service.operations.restore import finish_restore
from service.settings import Settings
from service.store.engines import files
from service.store.engines.failures import telling_of_database
from service.store.engines.revisions import alembic_config, known_revisions, require_known

log = logging.getLogger("surefoot.migrate")

_LOOK_S = 10.0  # reads a gigabyte or more
_KEPT_COPIES = 2


def migrate(settings: Settings) -> None:
    """Create or upgrade all tables and see to the key; one process at a time.

    Before the schema of a database changes it is copied, and where that fails put back.

    Raises:
        StartError: what keeps this data directory from being used, in one line.
    """
    folder = settings.data_dir
    make_private(folder)
    if settings.database_url is not None:
        from service.commands.postgresql.migrating import migrate_server

        migrate_server(settings)
        return
    with telling_of(folder):
        make_file(folder / MIGRATE_LOCK)
    with telling_of(folder), (folder / MIGRATE_LOCK).open("r+") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        finish_restore(folder)
        make_private(folder)
        make_file(settings.database_path)
        with telling_of_database(settings.database_path):
            _require_sound(settings.database_path)
            _migrate_tables(settings)
            migrate_engine_tables(settings)
            settle_key(settings)


def _require_sound(path: Path) -> None:
    """Refuse a damaged database before anything is made of it; a large one is looked at in part."""
    found = files.first_fault(path, _LOOK_S) if path.exists() and path.stat().st_size else None
    if found is not None:
        raise StartError(
            f"database: {path} is damaged ({' '.join(found.split())[:200]}); put a backup in its "
            "place by `surefoot restore`, `surefoot check` says more"
        )


def _migrate_tables(settings: Settings) -> None:
    path, head = settings.database_path, known_revisions()[0]
    found = files.revision(path)
    require_known(found, str(path))
    if found == head:
        return
    copy: Path | None = None
    if found is not None and settings.copy_before_migration:
        copy = _copy_before(path, head)
        log.info("database_copied", extra={"path": str(copy), "revision": found})
    import alembic.command  # 0.1 s that a start with nothing to migrate needs not

    try:
        alembic.command.upgrade(alembic_config(settings.store_url), "head")
    except Exception as error:
        if copy is None:
            raise
        files.copy(copy, path)
        reason = str(getattr(error, "orig", error)).splitlines()[0]
        raise StartError(
            f"migration: from {found} to {head} failed ({reason}); {path} is as it was, and {copy} "
            "a copy of it: install the release that ran before, and report this"
        ) from error
    log.info("migrated", extra={"from": found, "to": head})


def _copy_before(database: Path, revision: str) -> Path:
    """Copy a database beside it, and delete copies but the newest two; returns the copy.

    The copy is named by the revision that it is to be brought to.

    Raises:
        StartError: there is no space for it.
    """
    folder = database.parent / COPIES
    require_space(
        database.parent,
        files.size(database) + 2**20,
        "the copy before the migration (SUREFOOT_COPY_BEFORE_MIGRATION=false: none)",
    )
    folder.mkdir(mode=0o700, exist_ok=True)
    target = folder / f"{datetime.now(UTC):%Y%m%dT%H%M%S%fZ}-before-{revision}.sqlite"
    unfinished = target.with_suffix(".partial")
    for left in folder.glob("*.partial*"):
        left.unlink()
    files.copy(database, unfinished)
    files.drop_log(unfinished)
    unfinished.rename(target)
    sync_folder(folder)
    for old in sorted(folder.glob("*.sqlite"))[:-_KEPT_COPIES]:
        old.unlink()
    return target
