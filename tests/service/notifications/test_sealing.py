"""Secrets at rest, their key, and the modes of what lies in a data directory."""

import base64
import os
import secrets
import sqlite3
import stat

import pytest

from service.commands.key_rotation import rotate_key
from service.commands.migrate import migrate
from service.data_dir import StartError
from service.notifications.keys import Sealer, secret_of
from service.notifications.webhooks import WebhookSpec, create_webhook, rotate_secret
from service.reasons import ServiceCode
from service.settings import Settings
from service.store.engines.store import Store
from service.store.webhooks import WebhookRecord
from tests.stores.databases import only_sqlite

SPEC = WebhookSpec(
    url="https://example.org/hook", name="hook", kinds=None, format="webhook", enabled=True
)


def everything(settings):
    """All bytes of the database and its log."""
    folder = settings.data_dir
    return b"".join(path.read_bytes() for path in folder.glob("surefoot.sqlite*"))


def hook(settings):
    with Store(settings).write() as session:
        made = create_webhook(session, settings, SPEC)
        return made.record.id, made.secret


def read(settings, webhook_id):
    with Store(settings).read() as session:
        return secret_of(settings, session.get(WebhookRecord, webhook_id))


@only_sqlite("reads the file")
def test_a_secret_is_in_the_answer_and_not_in_the_file(settings):
    webhook_id, secret = hook(settings)
    assert secret.startswith("whsec_")
    assert read(settings, webhook_id) == secret
    with Store(settings).write() as session:
        later = rotate_secret(session, settings, webhook_id).secret
    assert read(settings, webhook_id) == later != secret
    assert b"whsec_" not in everything(settings)


def test_a_key_is_made_once_and_is_nobody_elses(settings):
    path = settings.data_dir / "secret.key"
    before = path.read_text()
    assert len(base64.b64decode(before)) == 32
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    migrate(settings)
    assert path.read_text() == before


def test_a_lost_or_foreign_key_is_told_and_nothing_is_lost(settings):
    webhook_id, secret = hook(settings)
    path = settings.data_dir / "secret.key"
    right = path.read_text()
    path.unlink()
    with pytest.raises(StartError, match="secret.key is missing, and 1 stored secrets are sealed"):
        migrate(settings)
    assert not path.exists()
    path.write_text(base64.b64encode(secrets.token_bytes(32)).decode())
    with pytest.raises(StartError, match="does not open the stored secrets"):
        migrate(settings)
    path.write_text("rubbish")
    with pytest.raises(StartError, match="secret.key: 32 bytes in base64 are needed"):
        migrate(settings)
    path.write_text(right)
    migrate(settings)
    assert read(settings, webhook_id) == secret


def test_the_key_of_the_environment_needs_no_file(tmp_path):
    key = base64.urlsafe_b64encode(secrets.token_bytes(32)).decode()
    settings = Settings(data_dir=tmp_path / "data", secret_key=key)
    migrate(settings)
    webhook_id, secret = hook(settings)
    assert read(settings, webhook_id) == secret
    assert not (settings.data_dir / "secret.key").exists()
    assert key not in repr(settings)
    with pytest.raises(StartError, match="is missing, and 1 stored secrets"):
        migrate(settings.model_copy(update={"secret_key": None}))


def test_what_was_changed_or_moved_to_another_webhook_does_not_open():
    sealer = Sealer(secrets.token_bytes(32))
    sealed = sealer.seal("whsec_x", "webhook a")
    assert sealer.open(sealed, "webhook a") == "whsec_x"
    changed = sealed[:-6] + ("AAAAAA" if sealed[-6:] != "AAAAAA" else "BBBBBB")
    for text, purpose in ((sealed, "webhook b"), (changed, "webhook a")):
        with pytest.raises(StartError, match="does not open"):
            sealer.open(text, purpose)


def test_keys_are_rotated_within_files_and_to_the_environment_and_back(settings, tmp_path):
    webhook_id, secret = hook(settings)
    path = settings.data_dir / "secret.key"
    first = path.read_text()
    assert rotate_key(settings, None) == 1
    assert path.read_text() != first
    assert read(settings, webhook_id) == secret

    key = base64.b64encode(secrets.token_bytes(32)).decode()
    by_environment = settings.model_copy(update={"secret_key": key})
    with pytest.raises(StartError, match="not by SUREFOOT_SECRET_KEY; run `surefoot rotate-key`"):
        migrate(by_environment)
    assert rotate_key(by_environment, None) == 1
    assert not path.exists()
    migrate(by_environment)
    assert read(by_environment, webhook_id) == secret

    old = tmp_path / "old.key"
    old.write_text(key)
    assert rotate_key(settings, old) == 1
    migrate(settings)
    assert read(settings, webhook_id) == secret


@pytest.mark.parametrize("sealed_anew", [False, True])
def test_a_rotation_that_was_cut_off_is_ended_or_taken_back(settings, sealed_anew):
    webhook_id, secret = hook(settings)
    path = settings.data_dir / "secret.key"
    old = path.read_text()
    if sealed_anew:
        rotate_key(settings, None)
        (settings.data_dir / "secret.key.new").write_text(path.read_text())
        path.write_text(old)
    else:
        new = base64.b64encode(secrets.token_bytes(32)).decode()
        (settings.data_dir / "secret.key.new").write_text(new)
    migrate(settings)
    assert read(settings, webhook_id) == secret
    assert not (settings.data_dir / "secret.key.new").exists()


def test_a_key_that_is_lost_for_good_is_given_up_in_the_open(settings):
    webhook_id, secret = hook(settings)
    (settings.data_dir / "secret.key").unlink()
    with pytest.raises(StartError, match="secret.key is missing"):
        rotate_key(settings, None)
    assert rotate_key(settings, None, lost=True) == 1
    migrate(settings)
    assert read(settings, webhook_id) != secret
    with Store(settings).read() as session:
        record = session.get(WebhookRecord, webhook_id)
        assert not record.enabled
        assert [why.code for why in record.disabled_reasons] == [ServiceCode.SECRET_LOST]


def modes(folder):
    paths = [folder, *folder.rglob("*")]
    return {path.name: oct(stat.S_IMODE(path.stat().st_mode)) for path in paths}


def test_everything_is_private_also_what_was_not(tmp_path):
    settings = Settings(data_dir=tmp_path / "data")
    before = os.umask(0o022)
    try:
        settings.weights_dir.mkdir(parents=True)
        (settings.weights_dir / "0.safetensors").write_bytes(b"")
        sqlite3.connect(settings.database_path).execute("CREATE TABLE old (x)").connection.close()
        assert modes(tmp_path / "data")["surefoot.sqlite"] == "0o644"
        migrate(settings)
        store = Store(settings)
        with store.write():  # the log and its index are there
            found = modes(settings.data_dir)
    finally:
        os.umask(before)
    assert {"surefoot.sqlite-wal", "surefoot.sqlite-shm", "secret.key", "migrate.lock"} <= set(
        found
    )
    folders = {"data", "weights"}
    wide = {n: m for n, m in found.items() if m != ("0o700" if n in folders else "0o600")}
    assert wide == {}


def test_a_folder_that_holds_other_things_keeps_its_mode(tmp_path):
    folder = tmp_path / "home"
    folder.mkdir()
    folder.chmod(0o755)
    (folder / "letters").write_text("")
    migrate(Settings(data_dir=folder))
    assert modes(folder)["home"] == "0o755"
    assert modes(folder)["surefoot.sqlite"] == "0o600"
