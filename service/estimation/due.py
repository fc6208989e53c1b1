"""When a full estimate is due; between two of them, new tracks update the monitor alone."""

from dataclasses import dataclass

from service.enums import PoseState

# A stationary camera's pose hardly changes by fewer: a tenth of the window, 40 of 400 tracks.
NEW_SHARE = 0.1
_WATCHED_MOVE = 0.1  # probability of a move from which each run is a full one
_CALM = (PoseState.OK, PoseState.LEARNING)


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviousEstimate:
    """The last full estimate against the same reference.

    `new_tracks` of the window came after it; `has_new_input` is whether an image or a model did.
    """

    state: PoseState
    moved: float
    new_tracks: int
    has_new_input: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Circumstances:
    """The input of the decision whether a run is a full one.

    `asked`: a page or an operator asks for an estimate. `learned`: the reference is known.
    `alerted` and `unsure` are open alerts, `tracks` the number in the window. `suspicious` and
    `drifts_slowly` are results of the monitor.
    """

    asked: bool
    learned: bool
    previous: PreviousEstimate | None
    alerted: bool
    unsure: bool
    tracks: int
    suspicious: bool = False
    drifts_slowly: bool = False


def is_full_estimate_due(run: Circumstances) -> bool:
    """True if a full estimate can change something.

    It can if a page or an operator asks for it, an operator acted, an image or a model is new, a
    tenth of the window is new, the camera may have moved, or the chart or the probability of a move
    is above its watch level.
    """
    last = run.previous
    if run.asked or not run.learned or last is None or last.has_new_input:
        return True
    if run.alerted or run.unsure or last.state not in _CALM or last.moved >= _WATCHED_MOVE:
        return True
    if run.suspicious or run.drifts_slowly:
        return True
    return last.new_tracks >= NEW_SHARE * run.tracks
