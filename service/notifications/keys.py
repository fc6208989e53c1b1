"""The key of a data directory, that is not in the database, and the secrets that it seals."""

import base64
import contextlib
import hashlib
import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM
from sqlalchemy.orm import Session

from models.reasons import Reason
from service.data_dir import KEY_FILE, StartError, sync_folder, telling_of
from service.reasons import ServiceCode
from service.setting_values import read_key
from service.settings import Settings
from service.store import cameras, webhooks
from service.store.cameras import CameraRecord
from service.store.engines.store import Store
from service.store.webhooks import WebhookRecord

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


_SECRET_BYTES = 32  # the Standard Webhooks specification asks for 24 to 64
NEW_KEY_FILE = f"{KEY_FILE}.new"


def new_secret() -> str:
    """A secret of one endpoint, in the form that receivers' libraries take."""
    return f"whsec_{base64.b64encode(secrets.token_bytes(_SECRET_BYTES)).decode()}"


def secret_of(settings: Settings, record: WebhookRecord, *, old: bool = False) -> str | None:
    """A webhook's secret in plain text, or that of before the last rotation; None without any."""
    stored = record.old_secret if old else record.secret
    return None if stored is None else sealer_of(settings).open(stored, _webhook_purpose(record.id))


def sealed_secret(settings: Settings, webhook_id: str, secret: str) -> str:
    """The secret of a webhook as it is stored."""
    return sealer_of(settings).seal(secret, _webhook_purpose(webhook_id))


def settle_key(settings: Settings) -> None:
    """See that there is a key, and that it opens all stored secrets.

    A key file is made where there is no key and nothing was ever sealed with one. A rotation that
    was cut off is ended, or taken back.

    Raises:
        StartError: the key is missing or does not open what is stored.
    """
    stored = _stored_secrets(settings)
    sealed = [text for _, text in stored]
    path, new_path = settings.data_dir / KEY_FILE, settings.data_dir / NEW_KEY_FILE
    if settings.secret_key is None:
        if new_path.exists():
            _end_rotation(settings, sealed)
        if not path.exists():
            if sealed:
                raise StartError(
                    f"key: {path} is missing, and {len(sealed)} stored secrets are sealed by "
                    f"{key_id_of(sealed[0])}; put it back from a backup, or set SUREFOOT_SECRET_KEY"
                )
            write_key_file(path)
    _check_file_or_environment(settings, sealed)
    require_openable(sealer_of(settings), stored)


def reseal(session: Session, old: Sealer, new: Sealer) -> int:
    """Seal all secrets with another key; returns how many.

    Raises:
        StartError: the old key does not open one of them.
    """
    found = _sealed(session)
    for each in found:
        plain = old.open(each.text, each.purpose)
        setattr(each.record, each.column, new.seal(plain, each.purpose))
    return len(found)


def give_up_secrets(session: Session, new: Sealer) -> int:
    """Replace secrets after the key was lost; returns how many.

    Webhooks get new secrets and are disabled; credentials of cameras are deleted.
    """
    count = 0
    for hook in webhooks.every(session):
        if hook.secret is not None:
            hook.secret = new.seal(new_secret(), _webhook_purpose(hook.id))
            hook.old_secret = None
            hook.disable(Reason(code=ServiceCode.SECRET_LOST))
            count += 1
    for camera in cameras.with_credentials(session):
        camera.snapshot_credentials = None
        count += 1
    return count


def require_openable(sealer: Sealer, stored: Sequence[tuple[str, str]]) -> None:
    """Check that a key opens all secrets.

    Args:
        sealer: with the key.
        stored: purposes, and the secrets that are sealed for them.

    Raises:
        StartError: it does not open one.
    """
    for purpose, text in stored:
        sealer.open(text, purpose)


def _end_rotation(settings: Settings, sealed: list[str]) -> None:
    """The new key counts once the secrets are sealed by it; before, it never was."""
    path, new_path = settings.data_dir / KEY_FILE, settings.data_dir / NEW_KEY_FILE
    if sealed and read_key_file(new_path).key_id == key_id_of(sealed[0]):
        new_path.replace(path)
    else:
        new_path.unlink()


def _check_file_or_environment(settings: Settings, sealed: list[str]) -> None:
    """Tell who has set a key beside the file what to do."""
    path = settings.data_dir / KEY_FILE
    if settings.secret_key is None or not sealed or not path.exists():
        return
    wanted = key_id_of(sealed[0])
    if sealer_of(settings).key_id != wanted and read_key_file(path).key_id == wanted:
        raise StartError(
            f"key: the stored secrets are sealed by {path}, not by SUREFOOT_SECRET_KEY; run "
            "`surefoot rotate-key` to seal them by that, or unset it"
        )


def _stored_secrets(settings: Settings) -> list[tuple[str, str]]:
    """The purposes of all secrets, with the sealed secrets."""
    with contextlib.closing(Store(settings)) as store, store.read() as session:
        return [(each.purpose, each.text) for each in _sealed(session)]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sealed:
    """A column of a record that is sealed for a purpose."""

    record: WebhookRecord | CameraRecord
    column: str
    purpose: str

    @property
    def text(self) -> str:
        """The sealed secret."""
        return str(getattr(self.record, self.column))


def _sealed(session: Session) -> list[_Sealed]:
    """All secrets that are stored; `files.sealed_secrets` reads the same from a file."""
    hooks = [
        _Sealed(record=record, column=column, purpose=_webhook_purpose(record.id))
        for record in webhooks.every(session)
        for column in ("secret", "old_secret")
        if getattr(record, column) is not None
    ]
    return hooks + [
        _Sealed(record=record, column="snapshot_credentials", purpose=camera_purpose(record.id))
        for record in cameras.with_credentials(session)
    ]


def _webhook_purpose(webhook_id: str) -> str:
    return f"webhook {webhook_id}"


def camera_purpose(camera_id: str) -> str:
    """The purpose that the credentials of a camera are sealed for."""
    return f"camera {camera_id}"
