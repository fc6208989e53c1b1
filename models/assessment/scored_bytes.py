"""Scored tracks and the context of their window as bytes: rows of fixed size, little-endian."""

import numpy as np

from models.assessment.scored_tracks import ScoredTracks, WindowContext
from models.monitoring.group_scores import SCORES, ScoreContext
from models.tracks.linking import LinkScale

_TRACK = np.dtype(
    [
        *((name, "<i8") for name in ("key", "walk", "group")),
        *((name, "<f8") for name in ("started_s", "ended_s")),
        ("values", "<f8", (SCORES,)),
    ]
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
