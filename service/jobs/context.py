"""What every job in a worker process is given."""

import threading
from dataclasses import dataclass, field

from service.job_queue import JobQueue
from service.jobs.in_hand import InHand
from service.settings import Settings
from service.store.sqlite.database import Store


@dataclass(frozen=True, slots=True, kw_only=True)
class JobContext:
    """The worker's settings, store and queue; `stopping` is set when the process should end.

    `no_growth_before_s` rests the growth of flow maps that has failed, by camera, on the monotonic
    clock.
    """

    settings: Settings
    store: Store
    queue: JobQueue
    stopping: threading.Event = field(default_factory=threading.Event)
    in_hand: InHand = field(default_factory=InHand)
    no_growth_before_s: dict[str, float] = field(default_factory=dict)
