"""Secrets of a database that was just migrated: sealed by a key that is there."""

import logging

from service.notifications.keys import settle_key
from service.settings import Settings
from service.store.database.store import Store
from service.store.sqlite import files

log = logging.getLogger("surefoot.migrate")


def settle_keys(settings: Settings) -> None:
    """Seal what is not; where the database is a file, no trace of it stays in that or its log.

    Raises:
        StartError: the key is missing or does not open what is stored.
    """
    is_file = settings.database_url is None
    store = Store(settings)
    try:
        with store.write() as session:
            if is_file:
                files.overwrite_deleted(session)
            sealed = settle_key(session, settings)
    finally:
        store.close()
    if not sealed:
        return
    if is_file:
        files.wipe_log(settings.database_path)
    log.info("secrets_sealed", extra={"secrets": sealed})
