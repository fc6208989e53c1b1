"""The store: each concern's tables with their statements, and every SQL statement there is.

All tables are known as soon as one is, for a key may name any of them.
"""

from service.store import (  # noqa: F401
    access,
    activity,
    alerts,
    cameras,
    estimates,
    events,
    flow_maps,
    maintenance,
    predictions,
    references,
    rhythms,
    snapshots,
    sources,
    stored_tracks,
    trainings,
    webhooks,
    workers,
)
