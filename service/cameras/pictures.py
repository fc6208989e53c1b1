"""The pictures of cameras that were posted to: a post need not ask for what hardly ever changes."""

from sqlalchemy import Connection

from service.cameras.cameras import no_camera
from service.store import cameras
from service.store.cameras import Picture
from service.store.engines.store import Store

_MOST = 10_000


class StalePictureError(Exception):
    """Tracks were read by the picture of a camera that has been changed since."""


class Pictures:
    """What a process knows of pictures. Who writes compares it with what is there by then."""

    def __init__(self) -> None:
        self._known: dict[str, Picture] = {}

    def of(self, store: Store, camera_id: str) -> Picture:
        """The picture of a camera as it was when it was last asked for.

        Raises:
            NotFoundError: there was no such camera.
        """
        return self._known.get(camera_id) or self.again(store, camera_id)

    def again(self, store: Store, camera_id: str) -> Picture:
        """The picture of a camera as it is.

        Raises:
            NotFoundError: there is no such camera.
        """
        with store.look() as connection:
            found = cameras.picture(connection, camera_id)
        if found is None:
            self._known.pop(camera_id, None)
            raise no_camera(camera_id)
        if len(self._known) >= _MOST:
            self._known.clear()
        self._known[camera_id] = found
        return found


def check_picture(connection: Connection, camera_id: str, read_by: Picture) -> cameras.Awaited:
    """What tracks of a camera are awaited for, if its picture is the one that they were read by.

    Raises:
        NotFoundError: there is no such camera.
        StalePictureError: the picture is another by now.
    """
    awaited = cameras.awaited(connection, camera_id)
    if awaited is None:
        raise no_camera(camera_id)
    if awaited.picture != read_by:
        raise StalePictureError(camera_id)
    return awaited
