"""When a full estimate is due; between two of them, new tracks update the monitor alone."""

from models.assessment import Monitored
from service.enums import PoseState
from service.estimation.evidence import Evidence

# A stationary camera's pose hardly changes by fewer: a tenth of the window, 40 of 400 tracks.
NEW_SHARE = 0.1
_WATCHED_MOVE = 0.1  # probability of a move from which each run is a full one
_CALM = (PoseState.OK, PoseState.LEARNING)


def is_full_estimate_due(evidence: Evidence, monitored: Monitored) -> bool:
    """True if a full estimate can change something.

    It can if somebody asks for it, an operator acted, an image or a model is new, a tenth of the
    window is new, the camera may have moved, or the chart or the probability of a move is above its
    watch level.
    """
    last, state = evidence.previous, evidence.state
    if evidence.asked or evidence.site is None or last is None or last.has_new_input:
        return True
    if state.alerted or state.unsure or last.state not in _CALM or last.moved >= _WATCHED_MOVE:
        return True
    if monitored.suspicious or monitored.drifts_slowly:
        return True
    return last.new_tracks >= NEW_SHARE * len(evidence.tracks)
