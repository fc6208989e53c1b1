"""A camera's site as far as it is known: how people walk before it, where, and what is usual."""

from dataclasses import dataclass

from models.drift.chart import DriftChart
from models.drift.group_scores import Usual
from models.estimation.joint.speed_reference import SpeedReference
from models.flow.reference import FlowReference
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSite:
    """A camera at its prior pose, and what is known of the people before it.

    `speed_reference` is how they walk, learned or assumed. `flow` is where they do and `chart` how
    their scores scatter; None where too few people walked to learn it.
    """

    intrinsics: Intrinsics
    prior: CameraPose
    speed_reference: SpeedReference
    flow: FlowReference | None = None
    chart: DriftChart | None = None

    @property
    def learned(self) -> bool:
        """Whether anything of it was learned; else a walking speed is assumed, and no more."""
        return self.speed_reference.tracks > 0

    def usual(self, flow: FlowReference, chart: DriftChart) -> Usual:
        """What its flow map and its chart take for usual, seen from the prior pose."""
        return Usual(
            prior=self.prior,
            speed_reference=chart.speed_reference,
            paths=flow.site(self.intrinsics),
        )
