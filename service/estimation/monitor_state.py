"""The monitor's state between full estimates: what it depends on, and its form as bytes."""

import hashlib
from importlib.metadata import version

import numpy as np
from sqlalchemy.orm import Session

from models.assessment import Monitored, ScoredTracks, WindowContext, scored_window
from models.geometry.rotation import Index
from models.monitoring.group_scores import SCORES, ScoreContext
from models.tracks.linking import LinkScale
from service.store import monitor_states
from service.store.cameras import CameraRecord
from service.store.monitor_states import MonitorStateRecord
from service.store.references import SiteReferenceRecord
from service.store.windows import WindowBounds

_TRACK = np.dtype(
    [
        *((name, "<i8") for name in ("key", "walk", "group")),
        *((name, "<f8") for name in ("started_s", "ended_s")),
        ("values", "<f8", (SCORES,)),
    ]
)
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


def scored_to_bytes(scored: ScoredTracks) -> bytes:
    """Scored tracks as they are stored."""
    rows = np.empty(scored.key.size, dtype=_TRACK)
    for name in _TRACK.names or ():
        rows[name] = getattr(scored, name)
    return rows.tobytes()


def scored_from_bytes(data: bytes) -> ScoredTracks:
    """The scored tracks of `scored_to_bytes`."""
    rows = np.frombuffer(data, dtype=_TRACK)
    return ScoredTracks(**{name: np.ascontiguousarray(rows[name]) for name in _TRACK.names or ()})


def context_to_bytes(context: WindowContext) -> bytes:
    """A context as it is stored; without a scale of links its first three numbers are NaN."""
    links, scores = context.links, context.scores
    scale = (np.nan,) * 3 if links is None else (links.usual_mps, links.log_room, links.rivals)
    return np.array([*scale, scores.origin_s, *scores.busyness], dtype="<f8").tobytes()


def context_from_bytes(data: bytes) -> WindowContext:
    """The context of `context_to_bytes`."""
    values = np.frombuffer(data, dtype="<f8").astype(np.float64)
    usual_mps, log_room, rivals, origin_s = (float(value) for value in values[:4])
    links = None
    if np.isfinite(usual_mps):
        links = LinkScale(usual_mps=usual_mps, log_room=log_room, rivals=rivals)
    return WindowContext(links=links, scores=ScoreContext(origin_s=origin_s, busyness=values[4:]))
