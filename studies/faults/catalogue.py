"""All injectors by name, each with a usual size, and when they set in."""

from collections.abc import Sequence
from dataclasses import dataclass

from models.tracks.scenes import SceneTrack
from studies.faults.boxes import box_jitter, detector_update, rounding
from studies.faults.clocks import drifting_clock, dropped_frames, jittered_clock, wrong_rate
from studies.faults.hidden_feet import hidden_feet, jumps
from studies.faults.identities import fragments, switches
from studies.faults.lens_and_ground import (
    ramp,
    wrong_focal_length,
    wrong_k1,
    wrong_principal_point,
)
from studies.faults.traffic import cars, cyclists, other_paths, runners, standers, strollers
from studies.faults.view import Injector, View


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """An injector at a size; `later` where it sets in after the reference, else it was always so.

    `words` say the size as a table does.
    """

    injector: Injector
    size: float
    words: str
    later: bool = False

    def inject(self, tracks: Sequence[SceneTrack], view: View, seed: int) -> list[SceneTrack]:
        """The tracks with the fault."""
        return self.injector(tracks, view, self.size, seed)


FAULTS = {
    "fragments": Fault(injector=fragments, size=3.0, words="pieces of 2 to 4 s"),
    "fragments-later": Fault(
        injector=fragments, size=3.0, words="pieces of 2 to 4 s, after the reference", later=True
    ),
    "switches": Fault(injector=switches, size=0.3, words="at 30 % of meetings"),
    "hidden-feet": Fault(injector=hidden_feet, size=0.2, words="20 % of feet"),
    "hidden-feet-later": Fault(
        injector=hidden_feet, size=0.2, words="20 % of feet, after the reference", later=True
    ),
    "jumps": Fault(injector=jumps, size=0.2, words="20 % of the time"),
    "jumps-later": Fault(
        injector=jumps, size=0.2, words="20 % of the time, after the reference", later=True
    ),
    "box-jitter": Fault(injector=box_jitter, size=0.03, words="3 % of a person's height"),
    "rounding": Fault(injector=rounding, size=6.0, words="to 6 px"),
    "detector-update": Fault(
        injector=detector_update, size=0.03, words="3 % of a person's height", later=True
    ),
    "dropped-frames": Fault(injector=dropped_frames, size=0.3, words="30 %"),
    "jittered-clock": Fault(injector=jittered_clock, size=0.2, words="200 ms"),
    "drifting-clock": Fault(injector=drifting_clock, size=0.05, words="5 % fast at the end"),
    "slow-clock-later": Fault(
        injector=wrong_rate, size=0.2, words="30 Hz taken for 25, after the reference", later=True
    ),
    "fast-clock-later": Fault(
        injector=wrong_rate, size=-0.17, words="25 Hz taken for 30, after the reference", later=True
    ),
    "cyclists": Fault(injector=cyclists, size=0.2, words="20 %"),
    "cyclists-later": Fault(
        injector=cyclists, size=0.2, words="20 %, after the reference", later=True
    ),
    "cars": Fault(injector=cars, size=0.1, words="10 %"),
    "strollers": Fault(injector=strollers, size=0.1, words="10 %"),
    "standing": Fault(injector=standers, size=0.3, words="30 %"),
    "running": Fault(injector=runners, size=0.1, words="10 %"),
    "running-later": Fault(
        injector=runners, size=0.1, words="10 %, after the reference", later=True
    ),
    "other-paths-later": Fault(
        injector=other_paths, size=1.0, words="all, after the reference", later=True
    ),
    "ramp": Fault(injector=ramp, size=0.05, words="5 %"),
    "wrong-k1": Fault(injector=wrong_k1, size=0.05, words="by 0.05"),
    "wrong-focal-length": Fault(injector=wrong_focal_length, size=0.05, words="by 5 %"),
    "zoom-later": Fault(
        injector=wrong_focal_length, size=0.15, words="by 15 %, after the reference", later=True
    ),
    "wrong-principal-point": Fault(
        injector=wrong_principal_point, size=0.02, words="by 2 % of the width"
    ),
}
