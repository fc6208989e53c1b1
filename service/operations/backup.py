"""A data directory that may be in use, written to one checked archive that describes itself."""

import fcntl
import hashlib
import io
import json
import os
import shutil
import sqlite3
import tarfile
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import IO

from pydantic import TypeAdapter, ValidationError

from models.regression.recipe import weights_path
from service.data_dir import (
    DATABASE,
    KEY_FILE,
    MIGRATE_LOCK,
    WEIGHTS,
    StartError,
    require_space,
    sync_folder,
    telling_of,
)
from service.job_queue import ENGINE_TABLES
from service.notifications.keys import require_openable, sealer_of
from service.settings import Settings
from service.store.engines import files
from service.store.engines.failures import telling_of_database
from service.store.engines.revisions import require_known
from service.store.engines.schemas import require_schema

FORMAT = 1
MANIFEST = "manifest.json"
_CHUNK = 2**20


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A file of a backup: its name there and in the data directory."""

    name: str
    size: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """The first member of the archive. `key` is where the key is, if there is one."""

    format: int
    release: str
    revision: str
    sqlite: str
    made_at: str
    key: str  # archive, environment, none
    key_id: str
    missing_weights: list[str]
    members: list[Member]


def read_manifest(data: bytes) -> Manifest:
    """The manifest of an archive.

    Raises:
        StartError: it is none, or of a later format.
    """
    try:
        fields = json.loads(data)
        if fields["format"] > FORMAT:
            raise StartError(
                f"backup: its format is {fields['format']}, this release reads up to {FORMAT}; "
                "restore with the release that wrote it"
            )
        return TypeAdapter(Manifest).validate_json(data, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise StartError(
            f"backup: its manifest cannot be read ({where}: {first['msg']})"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise StartError(f"backup: its manifest cannot be read ({error!r})") from error


def require_plain(database: Path, what: str) -> None:
    """Check that a database has nothing that would run by itself, but what we have put there.

    Raises:
        StartError: it has.
    """
    if found := files.programs(database):
        raise StartError(
            f"{what} has a {found[0]} that is none of surefoot's; see where it is from"
        )


def release() -> str:
    """The version that runs."""
    try:
        return version("surefoot")
    except PackageNotFoundError:  # run out of a checkout
        return "unknown"


def hash_file(path: Path) -> Member:
    """A file's size and hash under its own name."""
    with path.open("rb") as file:
        return hash_stream(path.name, file)


def hash_stream(name: str, source: IO[bytes], target: IO[bytes] | None = None) -> Member:
    """Size and hash of what a stream has, which is copied to another if there is one."""
    digest, size = hashlib.sha256(), 0
    while chunk := source.read(_CHUNK):
        digest.update(chunk)
        size += len(chunk)
        if target is not None:
            target.write(chunk)
    return Member(name=name, size=size, sha256=digest.hexdigest())


Progress = Callable[[str, int, int], None]  # what, done, total
_TRIES = 3


def write_backup(settings: Settings, target: Path, on_progress: Progress) -> Manifest:
    """Write a backup, check it and give it its name; nothing is there before it is whole.

    Raises:
        StartError: there is nothing to back up, something is wrong in it, the target exists
            already, or there is no space for it.
    """
    folder = settings.data_dir
    if not settings.database_path.is_file() or not settings.database_path.stat().st_size:
        raise StartError(f"backup: {folder} holds no database; name another by --data-dir")
    if target.exists():
        raise StartError(f"backup: {target} exists already; name another file")
    if not target.parent.is_dir():
        raise StartError(f"backup: {target.parent} is no folder; make it, or name another")
    with telling_of(target.parent), telling_of_database(settings.database_path):
        weights = folder / WEIGHTS
        stored = sum(path.stat().st_size for path in weights.glob("*")) if weights.exists() else 0
        needed = 2 * files.size(settings.database_path) + stored + 2**20
        require_space(target.parent, needed, "the backup with its working copy")
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".surefoot-backup-") as name:
            scratch = Path(name)
            missing = _gather(settings, scratch, on_progress)
            manifest = _describe(settings, scratch, missing)
            partial = scratch / "archive"
            _pack(manifest, scratch, partial, on_progress)
            _verify(manifest, partial, on_progress)
            partial.rename(target)
            sync_folder(target.parent)
    return manifest


def _gather(settings: Settings, scratch: Path, on_progress: Progress) -> list[str]:
    """Copy the database and the weights that it names; returns names of weights that are gone."""
    database = scratch / DATABASE
    (scratch / WEIGHTS).mkdir()
    missing: list[str] = []
    for _ in range(_TRIES):
        database.unlink(missing_ok=True)
        with (settings.data_dir / MIGRATE_LOCK).open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH)  # no schema half way to another
            files.copy(
                settings.database_path,
                database,
                lambda done, total: on_progress("copying the database", done, total),
            )
        missing = _copy_weights(settings, scratch)
        # A model that retention deleted meanwhile is gone from the database too: once more.
        if not set(missing) & set(files.weights_of_models(settings.database_path).values()):
            break
    if missing and not set(missing) & set(files.weights_of_models(settings.database_path).values()):
        missing = []
    on_progress("checking the database", 0, 1)
    if found := files.faults(database):
        raise StartError(
            f"backup: {settings.database_path} is damaged ({found[0]}); put an earlier backup in "
            "its place by `surefoot restore`"
        )
    require_plain(database, f"backup: {settings.database_path}")
    require_known(files.revision(database), str(settings.database_path))
    require_schema(database, str(settings.database_path))
    files.empty(database, ENGINE_TABLES)  # what was queued is queued anew
    files.drop_log(database)
    on_progress("checking the database", 1, 1)
    return missing


def _copy_weights(settings: Settings, scratch: Path) -> list[str]:
    missing = []
    for digest in sorted(set(files.weights_of_models(scratch / DATABASE).values())):
        target = weights_path(scratch / WEIGHTS, digest)
        try:
            shutil.copyfile(weights_path(settings.weights_dir, digest), target)
        except FileNotFoundError:
            missing.append(digest)
            continue
        if hash_file(target).sha256 != digest:
            target.unlink()
            missing.append(digest)
    return missing


def _describe(settings: Settings, scratch: Path, missing: list[str]) -> Manifest:
    database = scratch / DATABASE
    secrets = files.sealed_secrets(database)
    key, key_id = "none", ""
    if settings.secret_key is not None or (settings.data_dir / KEY_FILE).exists() or secrets:
        sealer = sealer_of(settings)
        require_openable(sealer, secrets)
        key, key_id = "environment", sealer.key_id
        if settings.secret_key is None:
            shutil.copyfile(settings.data_dir / KEY_FILE, scratch / KEY_FILE)
            key = "archive"
    members = [hash_file(database)]
    if key == "archive":
        members.append(hash_file(scratch / KEY_FILE))
    for path in sorted((scratch / WEIGHTS).iterdir()):
        members.append(replace(hash_file(path), name=f"{WEIGHTS}/{path.name}"))
    return Manifest(
        format=FORMAT,
        release=release(),
        revision=files.revision(database) or "",
        sqlite=sqlite3.sqlite_version,
        made_at=datetime.now(UTC).isoformat(timespec="seconds"),
        key=key,
        key_id=key_id,
        missing_weights=missing,
        members=members,
    )


def _pack(manifest: Manifest, scratch: Path, partial: Path, on_progress: Progress) -> None:
    handle = os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "wb") as file:
        with tarfile.open(fileobj=file, mode="w", format=tarfile.PAX_FORMAT) as tar:
            description = json.dumps(asdict(manifest), indent=1).encode()
            tar.addfile(_header(MANIFEST, len(description)), io.BytesIO(description))
            for number, member in enumerate(manifest.members):
                on_progress("writing", number, len(manifest.members))
                with (scratch / member.name).open("rb") as content:
                    tar.addfile(_header(member.name, member.size), content)
        file.flush()
        os.fsync(file.fileno())
    on_progress("writing", len(manifest.members), len(manifest.members))


def _header(name: str, size: int) -> tarfile.TarInfo:
    header = tarfile.TarInfo(name)
    header.size, header.mode = size, 0o600
    header.mtime = int(datetime.now(UTC).timestamp())
    return header


def _verify(manifest: Manifest, partial: Path, on_progress: Progress) -> None:
    """Read the archive back as it lies on the disk."""
    found: list[Member] = []
    with tarfile.open(partial) as tar:
        for header in tar:
            content = tar.extractfile(header)
            assert content is not None
            if header.name == MANIFEST:
                assert read_manifest(content.read()) == manifest
                continue
            found.append(hash_stream(header.name, content))
            on_progress("checking", len(found), len(manifest.members))
    if found != manifest.members:
        raise StartError(f"backup: {partial} reads back differently; is the disk sound?")
