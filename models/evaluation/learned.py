"""What the estimators of a case learn of its reference, each thing learned once."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from models.estimation.joint.observations import Observations, observe
from models.estimation.joint.reference import learn_reference
from models.estimation.joint.site import SiteReference
from models.evaluation.protocol import Answer, ProtocolCase
from models.flow.reference import FlowReference, learn_flow
from models.simulation.walkers import WalkConfig

_SEED = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Learned:
    """A case with what is read of its tracks and learned of its site.

    `feet` and `feet_site` are without boxes; `flow` is None where too few people walk.
    """

    case: ProtocolCase
    seen: Observations
    site: SiteReference
    feet: Observations
    feet_site: SiteReference
    flow: FlowReference | None


LearnedEstimator = Callable[[Learned], Answer]


def learn_case(case: ProtocolCase) -> Learned:
    """All that estimators without a network need of a case.

    Raises:
        TooFewTrajectoriesError: fewer than 5 reference tracks with a step.
    """
    known, seen = (observe(tracks, case.intrinsics) for tracks in (case.reference, case.seen))
    site = learn_reference(known, case.prior_pose, WalkConfig(), _SEED)
    feet, feet_site = seen, site
    if site.statures is not None:  # else boxes are not used, and the feet's site is the same
        known_feet, feet = (
            observe([replace(track, top_v=None) for track in tracks], case.intrinsics)
            for tracks in (case.reference, case.seen)
        )
        feet_site = learn_reference(known_feet, case.prior_pose, WalkConfig(), _SEED)
    return Learned(
        case=case,
        seen=seen,
        site=site,
        feet=feet,
        feet_site=feet_site,
        flow=learn_flow(known, case.intrinsics, case.prior_pose, _SEED),
    )
