"""References of the estimators of a case, each learned once."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from models.pose import CameraSite, Observations, WalkConfig, learn_site, observe
from models.walking.reference_learning import learn_speed_reference
from models.walking.speed_reference import SpeedReference
from studies.protocol.cases import Answer, ProtocolCase

_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """A case with what is read of its tracks and learned of its site.

    `site` is what the service would learn; `feet` and `feet_speed_reference` are without boxes.
    """

    case: ProtocolCase
    seen: Observations
    site: CameraSite
    feet: Observations
    feet_speed_reference: SpeedReference


LearnedEstimator = Callable[[Learned], Answer]


def learn_case(case: ProtocolCase, *, chart: bool = False) -> Learned:
    """All that estimators without a network need of a case; the drift chart where it is wanted.

    Raises:
        TooFewTrajectoriesError: fewer than 5 reference tracks with a step.
    """
    known, seen = (
        observe(tracks, case.intrinsics, case.prior_pose) for tracks in (case.reference, case.seen)
    )
    site = learn_site(known, case.intrinsics, case.prior_pose, seed=_SEED, chart=chart)
    feet, feet_speed_reference = seen, site.speed_reference
    if (
        site.speed_reference.statures is not None
    ):  # else boxes are not used, and the feet's are the same
        known_feet, feet = (
            observe(
                [replace(track, top_v=None) for track in tracks], case.intrinsics, case.prior_pose
            )
            for tracks in (case.reference, case.seen)
        )
        feet_speed_reference = learn_speed_reference(
            known_feet, case.prior_pose, WalkConfig(), _SEED
        )
    return Learned(
        case=case, seen=seen, site=site, feet=feet, feet_speed_reference=feet_speed_reference
    )
