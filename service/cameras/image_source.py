"""The address of a camera's image and the credentials for it, stored sealed and never shown."""

import json
from functools import partial
from typing import Literal

from sqlalchemy.orm import Session

from service.addresses import origin_of
from service.data_dir import StartError
from service.errors import MalformedError
from service.notifications.fetch import (
    DEADLINE_S,
    Credentials,
    Fetched,
    FetchError,
    ImageSource,
    fetch,
)
from service.notifications.host_backoff import HostBackoff
from service.notifications.keys import camera_purpose, sealer_of
from service.settings import Settings
from service.store import cameras
from service.store.cameras import CameraRecord
from service.store.engines.store import Store


def set_image_source(
    record: CameraRecord,
    settings: Settings,
    url: str | None,
    credentials: Credentials | Literal[""] | None,
) -> None:
    """Change the address of a camera's image, its credentials, or both.

    Another scheme, host or port deletes the credentials and the note that Digest was asked for.

    Args:
        record: the camera.
        settings: the key that seals credentials.
        url: the new address; empty for none. None keeps the stored one.
        credentials: the new ones; empty for none. None keeps the stored ones.

    Raises:
        MalformedError: there are credentials, but no address.
    """
    if url is None and credentials is None:
        return
    before = record.snapshot_url
    if url is not None:
        record.snapshot_url = url or None
    now = record.snapshot_url
    if before is None or now is None or origin_of(before) != origin_of(now):
        record.snapshot_credentials, record.snapshot_digest = None, False
    if credentials == "":
        record.snapshot_credentials = None
    elif credentials is not None:
        if now is None:
            raise MalformedError.of_field(
                "snapshot_credentials", "a snapshot_url is needed, got none"
            )
        words = [origin_of(now), credentials.user, credentials.password]
        sealer, purpose = sealer_of(settings), camera_purpose(record.id)
        record.snapshot_credentials = sealer.seal(json.dumps(words), purpose)
    record.snapshot_due_at = record.snapshot_error = None


def fetch_image(
    store: Store,
    settings: Settings,
    camera_id: str,
    hosts: HostBackoff,
    within_s: float = DEADLINE_S,
) -> Fetched:
    """The image of a camera now, from its `snapshot_url`; no session is open meanwhile.

    Raises:
        FetchError: no image came, or the camera has no `snapshot_url`.
    """
    with store.read() as session:
        source = _image_source(session, settings, session.get(CameraRecord, camera_id))
    return fetch(settings, source, hosts, partial(_note_digest, store, camera_id), within_s)


def _image_source(session: Session, settings: Settings, record: CameraRecord | None) -> ImageSource:
    if record is None or record.snapshot_url is None:
        raise FetchError("the camera has no snapshot_url")
    digest_only = record.snapshot_digest
    if record.snapshot_credentials is not None and not digest_only:
        origins = map(origin_of, cameras.digest_urls(session))
        digest_only = origin_of(record.snapshot_url) in origins
    return ImageSource(
        url=record.snapshot_url,
        credentials=_credentials(settings, record, origin_of(record.snapshot_url)),
        digest_only=digest_only,
    )


def _credentials(settings: Settings, record: CameraRecord, origin: str) -> Credentials | None:
    if record.snapshot_credentials is None:
        return None
    try:
        text = sealer_of(settings).open(record.snapshot_credentials, camera_purpose(record.id))
    except StartError as error:
        raise FetchError(f"snapshot_credentials: {error}") from error
    sealed_for, user, password = json.loads(text)
    # Not the address that they were given for: the database was changed by hand.
    return Credentials(user=user, password=password) if sealed_for == origin else None


def _note_digest(store: Store, camera_id: str) -> None:
    with store.write(camera_id) as session:
        camera = session.get(CameraRecord, camera_id)
        if camera is not None:
            camera.snapshot_digest = True
