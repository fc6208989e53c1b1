"""Records of the store: all are known as soon as one is, for a key may name any table."""

from service.store.tables import (
    access,
    activity,
    alerts,
    attendance,
    cameras,
    deliveries,
    estimates,
    operation,
    references,
    tracks,
    trainings,
)

__all__ = [
    "access",
    "activity",
    "alerts",
    "attendance",
    "cameras",
    "deliveries",
    "estimates",
    "operation",
    "references",
    "tracks",
    "trainings",
]
