"""What every job in a worker process is given."""

import threading
from dataclasses import dataclass, field

from service.job_queue import JobQueue
from service.settings import Settings
from service.store.engines.store import Store
from service.training.steps import StepWatch
from service.workers.growth_rests import GrowthRests, GrowthTurns
from service.workers.in_hand import InHand
from service.workers.rota import Rota


@dataclass(frozen=True, slots=True, kw_only=True)
class JobContext:
    """The worker's settings, store and queue; `stopping` is set when the process should end."""

    settings: Settings
    store: Store
    queue: JobQueue
    stopping: threading.Event = field(default_factory=threading.Event)
    in_hand: InHand = field(default_factory=InHand)
    growth_rests: GrowthRests = field(default_factory=GrowthRests)
    growth_turns: GrowthTurns = field(default_factory=GrowthTurns)
    steps: StepWatch = field(default_factory=StepWatch)
    reconciled: Rota = field(default_factory=Rota)
