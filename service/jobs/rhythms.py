"""The hourly look at when each camera sees people."""

import logging
from datetime import UTC, datetime

from service.jobs.context import JobContext
from service.jobs.in_hand import UPKEEP
from service.recalibration import upkeep
from service.recalibration.rhythms import keep_rhythm, learn, take_arrivals

log = logging.getLogger("surefoot.jobs")


def run_rhythms(context: JobContext) -> None:
    """Learn every camera's rhythm anew; before retention, so that its hours are counted whole."""
    with context.store.read() as session:
        ids = upkeep.camera_ids(session)
    learned = 0
    for camera_id in ids:
        with context.in_hand.task(UPKEEP, "rhythms", camera_id):
            learned += _learn(context, camera_id)
    log.info("rhythms_learned", extra={"cameras": learned})


def _learn(context: JobContext, camera_id: str) -> bool:
    now = datetime.now(UTC)
    with context.store.read() as session:
        arrivals = take_arrivals(session, camera_id, now)
    if arrivals is None:
        return False
    rhythm, counts = learn(arrivals, context.settings, now)
    with context.store.write() as session:
        keep_rhythm(session, camera_id, rhythm, counts, now)
    return rhythm is not None
