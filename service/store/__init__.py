"""The store: each concern's tables with their statements, and all SQL but that of the job engine's.

All tables are known as soon as one is, for a key may name any of them.
"""

from service.store import (  # noqa: F401
    access,
    alerts,
    cameras,
    estimates,
    journal,
    monitor_states,
    references,
    sources,
    tracks,
    trainings,
    webhooks,
    windows,
    workers,
)
