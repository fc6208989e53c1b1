"""The estimate job: new tracks to predictions, a reference, a stored estimate."""

import logging

from service.jobs.context import JobContext
from service.jobs.predictions import predict_pending
from service.recalibration.estimates import store_estimate
from service.recalibration.evidence import gather, weigh
from service.recalibration.growth import grow, keep_growth, take_growth
from service.recalibration.learning import keep_reference, learn_period, take_period
from service.recalibration.looking import begin_look, end_look

log = logging.getLogger("surefoot.jobs")


def run_estimate(context: JobContext, camera_id: str) -> None:
    """Bring a camera's reference and estimate up to date with its tracks.

    The mark "due" is taken off first: tracks that arrive from then on queue a job of their own.
    No transaction is open while anything is computed.
    """
    store, settings = context.store, context.settings
    with store.write() as session:
        newest_pk = begin_look(session, camera_id)
    predict_pending(context, camera_id)
    learn_if_due(context, camera_id)
    with store.read() as session:
        evidence = gather(session, settings, camera_id)
    finding = None if evidence is None else weigh(evidence, settings.seed)
    with store.write() as session:
        if evidence is not None and finding is not None:
            record = store_estimate(session, context.queue, settings, evidence, finding)
            if record is not None:
                fields = {"tracks": record.tracks, "state": record.state}
                log.info("estimate_stored", extra={"camera_id": camera_id, **fields})
        end_look(session, camera_id, newest_pk)
    grow_if_due(context, camera_id)


def learn_if_due(context: JobContext, camera_id: str) -> None:
    """Learn a camera's reference, once its tracks are there."""
    with context.store.read() as session:
        period = take_period(session, context.settings, camera_id)
    if period is None:
        return
    learned = learn_period(period, context.settings.seed)
    with context.store.write() as session:
        keep_reference(session, context.settings, camera_id, period, learned)
    log.info(
        "reference_learned" if learned else "reference_without_walkers",
        extra={"camera_id": camera_id, "tracks": len(period.trajectories)},
    )


def grow_if_due(context: JobContext, camera_id: str) -> None:
    """Learn a camera's flow map anew, once enough tracks have come that are known to be still.

    A worker that dies here leaves the map as it was; the next job finds it due again.
    """
    with context.store.read() as session:
        period = take_growth(session, context.settings, camera_id)
    if period is None:
        return
    learned = grow(period, context.settings.seed)
    with context.store.write() as session:
        grown = keep_growth(session, camera_id, period, learned)
    if grown:
        fields = {"camera_id": camera_id, "tracks": len(period.trajectories)}
        log.info("flow_map_grown", extra=fields)
