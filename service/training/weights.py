"""Weights that several machines share: in the database, and on each disk once it has used them."""

import hashlib
import logging
import os

from sqlalchemy.orm import Session

from models.regression.weights_files import weights_path
from service.settings import Settings
from service.store import trainings
from service.store.engines.store import Store

log = logging.getLogger("surefoot.jobs")


def share_weights(session: Session, settings: Settings, sha256: str) -> None:
    """Keep weights beside the model that is published with them, where there is a server."""
    if settings.database_url is not None and not trainings.has_weights(session, sha256):
        trainings.keep_weights(
            session, sha256, weights_path(settings.weights_dir, sha256).read_bytes()
        )


def fetch_weights(store: Store, settings: Settings, sha256: str) -> None:
    """See that weights are on this machine's disk, if they are anywhere; whole or not at all."""
    path = weights_path(settings.weights_dir, sha256)
    if settings.database_url is None or path.exists():
        return
    with store.read() as session:
        data = trainings.weights(session, sha256)
    if data is None or hashlib.sha256(data).hexdigest() != sha256:
        return  # who reads the file says that it cannot
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.fetched")
    partial.write_bytes(data)
    partial.replace(path)
    log.info("weights_fetched", extra={"sha256": sha256, "bytes": len(data)})
