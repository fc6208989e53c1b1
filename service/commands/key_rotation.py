"""Seal the secrets of a data directory with another key."""

from pathlib import Path

from service.data_dir import KEY_FILE, held_alone, make_private, require_stopped
from service.notifications.keys import (
    NEW_KEY_FILE,
    give_up_secrets,
    read_key_file,
    reseal,
    sealer_of,
    write_key_file,
)
from service.settings import Settings
from service.store.engines import files
from service.store.engines.store import Store


def rotate_key(settings: Settings, old_key_file: Path | None, *, lost: bool = False) -> int:
    """Seal by SUREFOOT_SECRET_KEY, or by a new key file; returns how many secrets.

    Nothing may use the data directory. Its own key file is the old one if none is named. If the old
    key is `lost`, webhooks get new secrets and are disabled, and cameras have no credentials.

    Raises:
        StartError: something uses it, or the old key does not open what is stored.
    """
    folder = settings.data_dir
    path, new_path = folder / KEY_FILE, folder / NEW_KEY_FILE
    make_private(folder)
    with held_alone(folder):
        require_stopped(folder)
        old = None if lost else read_key_file(old_key_file or path)
        if settings.secret_key is not None:
            new = sealer_of(settings)
        else:
            new_path.unlink(missing_ok=True)
            new = write_key_file(new_path)
        store = Store(settings)
        try:
            with store.write() as session:
                files.overwrite_deleted(session)
                count = give_up_secrets(session, new) if old is None else reseal(session, old, new)
        except BaseException:
            new_path.unlink(missing_ok=True)
            raise
        finally:
            store.close()
        if settings.secret_key is None:
            new_path.replace(path)  # cut off before this, the next start does it
        else:
            path.unlink(missing_ok=True)
    return count
