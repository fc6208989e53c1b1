"""The site of a camera: how people walk before it, where, and what is usual."""

from dataclasses import dataclass

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.monitoring.chart import DriftChart
from models.monitoring.group_scores import Usual
from models.paths.reference import PathReference
from models.walking.speed_reference import SpeedReference


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSite:
    """A camera at its prior pose, and what is known of the people before it.

    `speed_reference` is how they walk, learned or assumed. `paths` are where they do and `chart`
    how their scores scatter; None where too few people walked to learn it.
    """

    intrinsics: Intrinsics
    prior: CameraPose
    speed_reference: SpeedReference
    paths: PathReference | None = None
    chart: DriftChart | None = None

    @property
    def learned(self) -> bool:
        """True if anything of it was learned; else a walking speed is assumed, and no more."""
        return self.speed_reference.tracks > 0

    def usual(self, paths: PathReference, chart: DriftChart) -> Usual:
        """The scores that its paths and its chart take for usual, seen from the prior pose."""
        return Usual(
            prior=self.prior,
            speed_reference=chart.speed_reference,
            paths=paths.model(self.intrinsics),
        )
