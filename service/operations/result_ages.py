"""Age of the fleet's results: how far monitoring and full estimates are behind the tracks."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from sqlalchemy.orm import Session

from service.enums import RunKind
from service.store import fleet

# The oldest track of each camera that no run has read, and when it arrived.
Waiting = Mapping[str, tuple[int, datetime]]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultAges:
    """Median, 95th percentile and maximum over all cameras that have a result and a track."""

    median_s: float
    p95_s: float
    worst_s: float


def result_ages(session: Session, waiting: Waiting, now: datetime) -> dict[RunKind, ResultAges]:
    """The age of results by the kind of run that makes them; kinds without any are missing.

    Monitoring: from the arrival of a camera's newest track to `checked_at`, or to now from the
    oldest track that waits. Full estimates: from `updated_at` to the newest track, 0 if the
    estimate is the newer one.
    """
    ages: dict[RunKind, list[float]] = {kind: [] for kind in RunKind}
    for camera_id, received_at, checked_at, updated_at in fleet.result_times(session):
        if camera_id in waiting:
            ages[RunKind.MONITOR].append(_seconds(waiting[camera_id][1], now))
        elif checked_at is not None:
            ages[RunKind.MONITOR].append(_seconds(received_at, checked_at))
        if updated_at is not None:
            ages[RunKind.FULL].append(_seconds(updated_at, received_at))
    return {kind: _over_the_fleet(found) for kind, found in ages.items() if found}


def _seconds(first: datetime, last: datetime) -> float:
    return max((last - first).total_seconds(), 0.0)


def _over_the_fleet(ages: list[float]) -> ResultAges:
    median_s, p95_s, worst_s = np.quantile(ages, [0.5, 0.95, 1.0]).tolist()
    return ResultAges(median_s=median_s, p95_s=p95_s, worst_s=worst_s)
