"""Whether a camera's model was trained for the step at which its tracks are sampled."""

import time

from sqlalchemy.orm import Session

from service.training.trainings import camera_step_s

# A model reads tracks at another step than its own, but less well the farther they are apart.
_STEP_RATIO = 1.3
_AGAIN_S = 600.0


class StepWatch:
    """Remembers the steps that tracks offer: they are read out of 200 tracks, and hardly change."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[float, float]] = {}

    def fits(self, session: Session, camera_id: str, model_step_s: float) -> bool:
        """Whether a model of a step suits a camera's tracks, by what they were 10 minutes ago.

        What does not suit is asked anew.
        """
        asked_s, step_s = self._known.get(camera_id, (-_AGAIN_S, 0.0))
        now_s = time.monotonic()
        if now_s - asked_s >= _AGAIN_S or not _near(step_s, model_step_s):
            step_s = camera_step_s(session, camera_id)
            self._known[camera_id] = now_s, step_s
        return _near(step_s, model_step_s)


def _near(step_s: float, other_s: float) -> bool:
    return 1 / _STEP_RATIO < step_s / other_s < _STEP_RATIO
