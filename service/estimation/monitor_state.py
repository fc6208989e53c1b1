"""The monitor's state between full estimates: what it depends on, and its form as bytes."""

import hashlib
from importlib.metadata import version

from sqlalchemy.orm import Session

from models.assessment import (
    Monitored,
    WindowContext,
    context_to_bytes,
    scored_to_bytes,
    scored_window,
)
from models.geometry.rotation import Index
from models.pose import LinkScale
from service.store import monitor_states
from service.store.cameras import CameraRecord
from service.store.monitor_states import MonitorStateRecord
from service.store.references import SiteReferenceRecord
from service.store.windows import WindowBounds

_CODE = (1, version("surefoot"))  # of the scores, and of the release that made them


def monitor_basis(
    session: Session,
    camera: CameraRecord,
    reference: SiteReferenceRecord,
    bounds: WindowBounds,
    inputs: monitor_states.Inputs | None = None,
) -> str:
    """The site, the window and the inputs that the scores of tracks depend on, by name."""
    inputs = inputs or monitor_states.inputs(session, camera.id, reference.id)
    known = (reference.id, reference.prior_pose_id, reference.ready_at, reference.answered_at)
    return repr((_CODE, known, camera.version, camera.intrinsics, bounds, inputs[:3]))


def basis_digest(basis: str, estimate_id: int) -> bytes:
    """Digest of a basis and of the full estimate that the monitor follows."""
    named = f"{basis} {estimate_id}".encode()
    return hashlib.blake2b(named, digest_size=16).digest()


def whole_window_state(
    camera_id: str,
    basis: bytes,
    monitored: Monitored,
    keys: Index,
    links: LinkScale | None,
    tracks_a_year: float,
) -> MonitorStateRecord | None:
    """The state after a run that scored the whole window; None if the next one has to, too."""
    scored = scored_window(monitored, keys)
    if scored is None or monitored.scores is None:
        return None
    context = WindowContext(links=links, scores=monitored.scores.context)
    return MonitorStateRecord(
        camera_id=camera_id,
        basis=basis,
        tracks_a_year=tracks_a_year,
        context=context_to_bytes(context),
        scored=scored_to_bytes(scored),
        newer=b"",
    )
