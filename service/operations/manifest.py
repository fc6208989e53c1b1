"""A backup's description: its release, schema, key, and the hash of each member."""

import hashlib
import json
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import IO

from service.data_dir import StartError

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

    def to_json(self) -> bytes:
        """As it lies in the archive."""
        return json.dumps(asdict(self), indent=1).encode()


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
        members = [Member(**member) for member in fields.pop("members")]
        return Manifest(**fields, members=members)
    except (ValueError, KeyError, TypeError) as error:
        raise StartError(f"backup: its manifest cannot be read ({error!r})") from error


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
