"""The marks of an estimate job on its camera: due, and looked at up to which track."""

from sqlalchemy.orm import Session

from service.store import cameras, tracks


def begin_look(session: Session, camera_id: str) -> int | None:
    """Take the mark "due" off a camera; returns the track that was stored last."""
    camera = cameras.find(session, camera_id)
    if camera is not None:
        camera.estimate_due_at = None
    return tracks.newest_pk(session, camera_id)


def end_look(session: Session, camera_id: str, newest_pk: int | None) -> None:
    """Note up to which track a job has looked; the reconcile sees what came after."""
    camera = cameras.find(session, camera_id)
    if camera is not None:
        camera.looked_at_pk = newest_pk
