"""The hourly look at when each camera sees people."""

import logging
from datetime import UTC, datetime

from service.alerts.arrival_rates import compute_rhythm, load_arrivals, save_rhythm
from service.workers.context import JobContext
from service.workers.in_hand import UPKEEP
from service.workers.upkeep import reconciliation

log = logging.getLogger("surefoot.jobs")


def run_rhythms(context: JobContext) -> None:
    """Learn every camera's rhythm anew; before retention, so that its hours are counted whole."""
    with context.store.read() as session:
        ids = reconciliation.camera_ids(session)
    learned = 0
    for camera_id in ids:
        with context.in_hand.task(UPKEEP, "rhythms", camera_id):
            learned += _learn(context, camera_id)
    log.info("rhythms_learned", extra={"cameras": learned})


def _learn(context: JobContext, camera_id: str) -> bool:
    now = datetime.now(UTC)
    with context.store.read() as session:
        arrivals = load_arrivals(session, camera_id, now)
    if arrivals is None:
        return False
    rhythm, counts = compute_rhythm(arrivals, context.settings, now)
    with context.store.write(camera_id) as session:
        save_rhythm(session, camera_id, rhythm, counts, now)
    return rhythm is not None
