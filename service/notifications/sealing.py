"""Secrets at rest: sealed with a key that is not in the database."""

import base64
import hashlib
import os
import secrets
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from service.data_dir import KEY_FILE, StartError, sync_folder, telling_of
from service.setting_values import read_key
from service.settings import Settings

_PREFIX = "sealed:1:"
_NONCE_BYTES = 12


@dataclass(frozen=True)
class Sealer:
    """AES-256-GCM with one key; what is sealed for one purpose does not open for another."""

    key: bytes = field(repr=False)

    @cached_property
    def key_id(self) -> str:
        """Eight hex digits that name the key and do not help to guess it."""
        return hashlib.sha256(b"surefoot key id" + self.key).hexdigest()[:8]

    def seal(self, text: str, purpose: str) -> str:
        """The sealed text: prefix, key id, nonce and ciphertext."""
        nonce = secrets.token_bytes(_NONCE_BYTES)
        sealed = AESGCM(self.key).encrypt(nonce, text.encode(), purpose.encode())
        return f"{_PREFIX}{self.key_id}:{base64.b64encode(nonce + sealed).decode()}"

    def open(self, sealed: str, purpose: str) -> str:
        """The text again.

        Raises:
            StartError: it was sealed with another key, for another purpose, or was changed.
        """
        named = key_id_of(sealed)
        try:
            data = base64.b64decode(sealed.removeprefix(f"{_PREFIX}{named}:"), validate=True)
            text = AESGCM(self.key).decrypt(
                data[:_NONCE_BYTES], data[_NONCE_BYTES:], purpose.encode()
            )
        except (InvalidTag, ValueError) as error:
            raise StartError(
                f"key: {self.key_id} does not open the stored secrets, sealed by {named}; put back "
                f"its {KEY_FILE} or SUREFOOT_SECRET_KEY, from a backup say"
            ) from error
        return text.decode()


def key_id_of(sealed: str) -> str:
    """The id of the key that something was sealed with."""
    return sealed.partition(_PREFIX)[2].split(":")[0]


def sealer_of(settings: Settings) -> Sealer:
    """The sealer of a data directory: by the environment's key, else by its key file.

    Raises:
        StartError: there is neither, or the file holds no key.
    """
    if settings.secret_key is not None:
        return Sealer(read_key(settings.secret_key))
    return read_key_file(settings.data_dir / KEY_FILE)


def read_key_file(path: Path) -> Sealer:
    """The sealer of a key file.

    Raises:
        StartError: it is not there, or holds no key.
    """
    with telling_of(path.parent):
        try:
            return Sealer(read_key(path.read_text()))
        except FileNotFoundError as error:
            raise StartError(
                f"key: {path} is missing; put it back from a backup, or set SUREFOOT_SECRET_KEY"
            ) from error
        except ValueError as error:
            raise StartError(f"key: {path}: {error}; put it back from a backup") from error


def write_key_file(path: Path) -> Sealer:
    """Make a key and write it to a file that is not there yet; it is on the disk on return."""
    key = secrets.token_bytes(32)
    with telling_of(path.parent):
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(base64.b64encode(key).decode() + "\n")
            file.flush()
            os.fsync(file.fileno())
        sync_folder(path.parent)
    return Sealer(key)
