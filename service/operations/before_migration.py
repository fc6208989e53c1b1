"""A copy of the database before its schema changes, so that a change can be undone."""

from datetime import UTC, datetime
from pathlib import Path

from service.data_dir import COPIES, require_space, sync_folder
from service.store.engines import files

_KEPT = 2


def copy_before(database: Path, revision: str) -> Path:
    """Copy a database beside it, and delete copies but the newest two; returns the copy.

    Args:
        database: nobody else writes its schema meanwhile.
        revision: what it is about to be brought to, for the name.

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
    for old in sorted(folder.glob("*.sqlite"))[:-_KEPT]:
        old.unlink()
    return target
