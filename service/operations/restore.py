"""A backup put into a data directory: verified first, then in place whole or not at all."""

import os
import re
import shutil
import tarfile
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from models.regression.recipe import weights_path
from service.data_dir import (
    COPIES,
    DATABASE,
    KEY_FILE,
    WEIGHTS,
    StartError,
    held_alone,
    make_private,
    require_space,
    require_stopped,
    sync_folder,
    telling_of,
)
from service.job_queue import ENGINE_REVISION, ENGINE_TABLES
from service.notifications.keys import read_key_file, require_openable, sealer_of
from service.operations.backup import (
    MANIFEST,
    Manifest,
    Member,
    Progress,
    hash_file,
    hash_stream,
    read_manifest,
    require_plain,
)
from service.settings import Settings
from service.store.engines import files
from service.store.engines.failures import telling_of_database
from service.store.engines.revisions import require_known
from service.store.engines.schemas import require_schema

_LARGEST_MANIFEST = 64 * 2**20
_WEIGHTS = re.compile(r"[0-9a-f]{64}\.safetensors")
READY = "restored"
_PARTS = (KEY_FILE, WEIGHTS, DATABASE)
_REPLACED = (DATABASE, f"{DATABASE}-wal", f"{DATABASE}-shm", KEY_FILE, f"{KEY_FILE}.new", WEIGHTS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Restored:
    """The backup that was put in place, and where what was there before is now."""

    manifest: Manifest
    replaced: Path | None


def restore_backup(
    settings: Settings, archive: Path, on_progress: Progress, *, force: bool
) -> Restored:
    """Verify an archive, then put it into the data directory, which nothing may use.

    With `force` what is there is moved aside; else only an empty folder is taken.

    Raises:
        StartError: the archive is damaged or of a later release, the folder is in use or not
            empty, or there is no space. Nothing was changed then.
    """
    folder = settings.data_dir
    make_private(folder)
    with held_alone(folder):
        require_stopped(folder)
        with telling_of(folder):
            finish_restore(folder)
            for left in folder.glob("restoring-*"):
                shutil.rmtree(left)
            if _has_data(folder) and not force:
                raise StartError(
                    f"restore: {folder} holds data; name an empty folder by --data-dir, or say "
                    "--force to move it aside"
                )
            unpacked = folder / f"restoring-{os.getpid()}"
            unpacked.mkdir(mode=0o700)
            try:
                manifest = _unpack(archive, unpacked, on_progress)
                with telling_of_database(archive):
                    _check(settings, manifest, unpacked, on_progress)
            except BaseException:
                shutil.rmtree(unpacked)
                raise
            # It decides: cut off before it, nothing has changed; after it, the next start goes on.
            unpacked.rename(folder / READY)
            sync_folder(folder)
            return Restored(manifest=manifest, replaced=finish_restore(folder))


def _unpack(archive: Path, folder: Path, on_progress: Progress) -> Manifest:
    """Write the members to a folder; each is as the manifest says, and none is missing."""
    try:
        with archive.open("rb") as file, tarfile.open(fileobj=file, mode="r:") as tar:
            first = tar.next()
            if first is None or first.name != MANIFEST or first.size > _LARGEST_MANIFEST:
                raise StartError(f"restore: {archive} is no backup of surefoot")
            content = tar.extractfile(first)
            assert content is not None
            manifest = read_manifest(content.read())
            wanted = {member.name: member for member in manifest.members}
            needed = sum(member.size for member in manifest.members)
            require_space(folder, needed + 2**20, "what is in the backup")
            require_known(manifest.revision, str(archive))
            for number, header in enumerate(tar):
                if not number:
                    continue  # the manifest
                on_progress("unpacking", number - 1, len(manifest.members))
                member = wanted.pop(header.name, None)
                content = tar.extractfile(header) if header.isreg() else None
                if member is None or content is None or header.size != member.size:
                    raise StartError(f"restore: {archive}: {header.name!r} is not as its manifest")
                _write(folder, member, content, archive)
    except FileNotFoundError as error:
        raise StartError(f"restore: {archive} is not there") from error
    except IsADirectoryError as error:
        raise StartError(f"restore: {archive} is a folder; name a file") from error
    except tarfile.TarError as error:
        raise StartError(f"restore: {archive} is no backup, or was cut off ({error})") from error
    if wanted:
        raise StartError(f"restore: {archive} was cut off: {', '.join(sorted(wanted))} missing")
    on_progress("unpacking", len(manifest.members), len(manifest.members))
    return manifest


def _write(folder: Path, member: Member, content: object, archive: Path) -> None:
    kind, _, name = member.name.rpartition("/")
    safe = member.name in (DATABASE, KEY_FILE) or (kind == WEIGHTS and _WEIGHTS.fullmatch(name))
    if not safe:
        raise StartError(f"restore: {archive}: a member {member.name!r} has no place")
    path = folder / member.name
    path.parent.mkdir(mode=0o700, exist_ok=True)
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "wb") as file:
        found = hash_stream(member.name, content, file)  # type: ignore[arg-type]
        file.flush()
        os.fsync(file.fileno())
    sync_folder(path.parent)
    if found != member:
        raise StartError(f"restore: {archive}: {member.name} is damaged; take another backup")


def _check(settings: Settings, manifest: Manifest, folder: Path, on_progress: Progress) -> None:
    """The database is sound, its weights are there, and a key opens its secrets.

    Nothing of it is run: its jobs are deleted, and queued anew from what the store says.
    """
    database = folder / DATABASE
    on_progress("checking", 0, 1)
    if not database.exists() or files.faults(database):
        raise StartError("restore: the database of the backup is damaged; take another backup")
    require_known(files.revision(database), "the backup")
    require_plain(database, "restore: the backup's database")
    require_schema(database, "the backup")
    if set(ENGINE_TABLES) <= files.tables(database):
        files.empty(database, ENGINE_TABLES)
    else:
        files.drop(database, (*ENGINE_TABLES, ENGINE_REVISION))  # the next start makes them
    files.drop_log(database)
    for digest in set(files.weights_of_models(database).values()) - set(manifest.missing_weights):
        path = weights_path(folder / WEIGHTS, digest)
        if not path.exists() or hash_file(path).sha256 != digest:
            raise StartError(f"restore: weights {digest} of the backup are missing or damaged")
    secrets = files.sealed_secrets(database)
    if secrets:
        in_archive = (folder / KEY_FILE).exists()
        if not in_archive and settings.secret_key is None:
            raise StartError(
                f"key: the backup was made with SUREFOOT_SECRET_KEY, id {manifest.key_id}; set it"
            )
        sealer = read_key_file(folder / KEY_FILE) if in_archive else sealer_of(settings)
        require_openable(sealer, secrets)
    on_progress("checking", 1, 1)


def finish_restore(folder: Path) -> Path | None:
    """Go on with a restore that was decided; None where there is none, or nothing was replaced."""
    ready = folder / READY
    if not ready.is_dir():
        return None
    # Kept as a name, which is there whole or not at all: with none, old files would stay in place.
    named = next(ready.glob("replaced-*"), None)
    if named is None:
        named = ready / f"replaced-{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
        named.touch()
        sync_folder(ready)
    aside = folder / named.name
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


def _has_data(folder: Path) -> bool:
    """True if a folder holds a database with something in it, a key, weights or copies."""
    database = folder / DATABASE
    if database.exists() and database.stat().st_size:
        return True
    return any((folder / name).exists() for name in (KEY_FILE, WEIGHTS, COPIES))
