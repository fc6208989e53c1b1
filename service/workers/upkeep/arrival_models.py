"""The hourly look at when each camera sees people."""

import logging
from datetime import UTC, datetime

from service.alerts.arrival_models import compute_arrival_model, load_arrivals, save_arrival_model
from service.store import cameras
from service.workers.context import JobContext
from service.workers.running_jobs import UPKEEP

log = logging.getLogger("surefoot.jobs")


def run_arrival_models(context: JobContext) -> None:
    """Learn every camera's arrival model anew, before retention: its hours are counted whole."""
    with context.store.read() as session:
        ids = cameras.ids(session)
    learned = 0
    for camera_id in ids:
        with context.running.job(UPKEEP, "rhythms", camera_id):
            learned += _learn(context, camera_id)
    log.info("rhythms_learned", extra={"cameras": learned})


def _learn(context: JobContext, camera_id: str) -> bool:
    now = datetime.now(UTC)
    with context.store.read() as session:
        arrivals = load_arrivals(session, camera_id, now)
    if arrivals is None:
        return False
    model, counts = compute_arrival_model(arrivals, context.settings, now)
    with context.store.write(camera_id) as session:
        save_arrival_model(session, camera_id, model, counts, now)
    return model is not None
