"""Put a verified data directory in the place of another, whole or not at all."""

import shutil
from datetime import UTC, datetime
from pathlib import Path

from service.data_dir import COPIES, DATABASE, KEY_FILE, WEIGHTS, sync_folder

READY = "restored"
_PARTS = (KEY_FILE, WEIGHTS, DATABASE)
_REPLACED = (DATABASE, f"{DATABASE}-wal", f"{DATABASE}-shm", KEY_FILE, f"{KEY_FILE}.new", WEIGHTS)


def commit_restore(unpacked: Path, folder: Path) -> Path | None:
    """Put what was unpacked in the place of what is there; returns where that was moved to.

    The renaming decides: cut off before it, nothing has changed; after it, the next start goes on.
    """
    unpacked.rename(folder / READY)
    sync_folder(folder)
    return finish_restore(folder)


def finish_restore(folder: Path) -> Path | None:
    """Go on with a restore that was decided; None where there is none, or nothing was replaced."""
    ready = folder / READY
    if not ready.is_dir():
        return None
    aside_name = ready / "replaced"
    if not aside_name.exists():
        aside_name.write_text(f"replaced-{datetime.now(UTC):%Y%m%dT%H%M%SZ}")
        sync_folder(ready)
    aside = folder / aside_name.read_text()
    marker = ready / "moved-aside"
    if not marker.exists():
        for path in (folder / name for name in _REPLACED):
            if path.is_file() and not path.stat().st_size:
                path.unlink()  # a database that was just begun
            elif path.exists():
                aside.mkdir(mode=0o700, exist_ok=True)
                path.rename(aside / path.name)
        marker.touch()
        sync_folder(folder)
        sync_folder(ready)
    for name in _PARTS:
        if (ready / name).exists():
            (ready / name).rename(folder / name)
    done = folder / f"restoring-{READY}"  # a name that nobody goes on with
    ready.rename(done)
    sync_folder(folder)
    shutil.rmtree(done)
    return aside if aside.exists() else None


def has_data(folder: Path) -> bool:
    """Whether a folder holds a database with something in it, a key, weights or copies."""
    database = folder / DATABASE
    if database.exists() and database.stat().st_size:
        return True
    return any((folder / name).exists() for name in (KEY_FILE, WEIGHTS, COPIES))
