"""Stage 1, observe: tracks to measurements."""

import numpy as np

from models.assessment.values import Observed, TrackWindow
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.tracks.linking import count_walks
from models.tracks.walks import observe_walks

MOST_PIECES = 5  # to a walk, on average: more tracks than that are not linked to be counted


def observe_window(
    window: TrackWindow, intrinsics: Intrinsics, prior: CameraPose, people: int
) -> Observed:
    """Measure the tracks of a window.

    `people` is how many have to come after an operator's answer before the pose is judged again.
    """
    tracks = window.trajectories
    walks = observe_walks(tracks, intrinsics, prior, window.before)
    unanswered = window.unanswered
    if unanswered is None:
        unanswered = np.ones(len(tracks), dtype=bool)
    since = [track for track, counts in zip(tracks, unanswered, strict=True) if counts]
    enough = len(since) >= people
    if people <= len(since) < MOST_PIECES * people:
        enough = count_walks(since, intrinsics, prior) >= people
    return Observed(
        tracks=walks.observations,
        started_s=tuple(float(track.time_s[0]) for track in tracks),
        ended_s=tuple(float(track.time_s[-1]) for track in tracks),
        unanswered=unanswered,
        walk_idx=walks.walk_idx,
        pieces=walks.reason,
        enough=enough,
    )
