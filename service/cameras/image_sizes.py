"""The image size that the numbers of a track source belong to, if its posts do not state one.

A doubt of the reference asks a question (`ImageQuestion`); a change of the camera answers it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from models.reasons import Reason, TracksCode
from service.alerts.alerts import close_pose_alerts
from service.enums import Outcome
from service.errors import ConflictError
from service.formats.scaling import ImageSize, image_sizes_of
from service.store import monitor_states, references, tracks, windows
from service.store.access import name_in
from service.store.cameras import CameraRecord

_CODES = (TracksCode.IMAGE_SHARES, TracksCode.OTHER_IMAGE_SIZE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageQuestion:
    """A question about the image size of tracks.

    `fixes` are changes of the camera that rescale its tracks, the most likely first; `keep` is the
    change that confirms pixels of the frame.
    """

    reason: Reason
    fixes: tuple[dict[str, Any], ...]
    keep: dict[str, Any]


def question_of(reasons: Sequence[Reason], camera: CameraRecord) -> ImageQuestion | None:
    """The question that a camera's reasons ask; None if there is none."""
    found = next((reason for reason in reasons if reason.code in _CODES), None)
    if found is None:
        return None
    fixes: list[dict[str, Any]] = [{"tracks_normalised": True}]
    if found.code == TracksCode.OTHER_IMAGE_SIZE:
        sizes = found.values["sizes_px"]
        assert not isinstance(sizes, float | str)
        fixes = [{"tracks_size": [int(side) for side in str(size).split("x")]} for size in sizes]
    keep = {"tracks_size": [camera.width, camera.height]}
    return ImageQuestion(reason=found, fixes=tuple(fixes), keep=keep)


def declared_size(camera: CameraRecord, source: str | None) -> ImageSize | None:
    """The declared image size of a source; None if nothing is declared."""
    return None if source is None else image_sizes_of(camera.image_sizes).get(source)


def declare_size(session: Session, camera: CameraRecord, size: ImageSize, by: str | None) -> bool:
    """Declare the image size of the active source; return whether stored tracks were rescaled.

    Later posts that state no image size are read by it, too. Alerts about the pose are closed if
    the tracks that opened them were rescaled.

    Raises:
        ConflictError: the camera has no tracks yet.
    """
    reference = references.newest(session, camera.id)
    source = reference.source
    if source is None:
        raise ConflictError(
            "tracks_size: the camera has no tracks yet; state the image size in the posts (`size`, "
            "`normalised`), or change the camera after the first post"
        )
    frame = (camera.width, camera.height)
    whole = ImageSize(size=frame)
    old = declared_size(camera, source) or whole
    new = size if size.normalised or size.size is not None else whole
    camera.image_sizes = {**(camera.image_sizes or {}), source: new.stored}
    reference.doubts = () if reference.ready_at is None else reference.doubts
    before, after = old.scaling(frame), new.scaling(frame)
    if before == after or not tracks.rescale(session, camera.id, source, before, after):
        return False
    windows.forget_predictions(session, camera.id, source)
    monitor_states.forget(session, camera.id)
    close_pose_alerts(session, camera.id, Outcome.RELEARNED, name_in(session, by))
    return True


def forget_sizes(camera: CameraRecord, sources: Sequence[str]) -> None:
    """Delete the declared image sizes of sources."""
    kept = {name: size for name, size in (camera.image_sizes or {}).items() if name not in sources}
    camera.image_sizes = kept or None


def forget_frame_size(camera: CameraRecord, frame: tuple[int, int]) -> None:
    """Delete confirmations that tracks are in pixels of a frame that the camera no longer has."""
    declared = image_sizes_of(camera.image_sizes)
    forget_sizes(camera, [name for name, each in declared.items() if each.size == frame])
