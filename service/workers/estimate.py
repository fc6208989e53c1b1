"""The estimate job: new tracks to predictions, a reference, a stored estimate."""

import logging
import time
from collections.abc import Callable
from functools import partial

from sqlalchemy.orm import Session

from models.assessment import Monitored
from models.effort import limited_effort
from models.errors import CheckpointError
from models.tracks.image_size import doubt_image_size
from service.enums import RunKind
from service.estimate_queue import (
    budget_of,
    fail_run,
    finish_run,
    leave_poisoned,
    note_partial_failures,
    skipped_by,
    start_run,
)
from service.estimation.anchoring import compute_anchor_days, load_anchor_days, save_anchor_days
from service.estimation.compute import ComputedEstimate, compute_estimate
from service.estimation.estimates import save_estimate, save_monitor_state
from service.estimation.evidence import Unpacked, load_evidence
from service.estimation.growth import compute_growth, load_growth, save_growth
from service.estimation.learning import (
    compute_reference,
    load_reference_period,
    save_progress,
    save_reference,
)
from service.estimation.monitor_run import load_new_tracks, monitor_new_tracks
from service.estimation.partial_failures import PartialFailures
from service.estimation.picture_estimates import save_by_picture
from service.estimation.pictures import compare, load_picture, save_picture
from service.estimation.proposal import compute_proposal, load_people, save_proposal
from service.estimation.seen_picture import ask_in_doubt
from service.reasons import Reasons
from service.store import monitor_states
from service.store.cameras import CameraRecord
from service.store.estimates import EstimateRecord
from service.store.run_budget import RunBudget
from service.store.runs import RunTotal
from service.training import drop_model, fetch_weights, load_pending, save_predictions
from service.workers.context import JobContext

log = logging.getLogger("surefoot.jobs")

_BATCH = 500  # tracks that are predicted at once


def run_estimate(context: JobContext, camera_id: str) -> None:
    """Bring a camera's reference and estimate up to date with its tracks.

    What fails beside the served estimate is said and stops nothing. Where that itself fails, the
    camera rests, longer each time, and the failure is told; others are not held up.
    """
    begun_s, kind = time.thread_time(), RunKind.FULL
    with context.store.write(camera_id) as session:
        _camera = session.get(CameraRecord, camera_id)  # kept, or each step would read it anew
        if leave_poisoned(session, camera_id):
            log.warning("estimate_postponed", extra={"camera_id": camera_id})
            return
        # The mark "due" goes first: tracks that arrive from then on ask for a look of their own.
        newest_pk, asked = start_run(session, camera_id)
        budget = budget_of(session, camera_id)
    try:
        with limited_effort(context.settings.estimate_cpu_s):
            kind = _look(context, camera_id, newest_pk, budget, asked=asked)
    except Exception as error:
        with context.store.write(camera_id) as session:
            fail_run(session, camera_id, repr(error))
        raise
    finally:
        context.runs.add(kind, RunTotal(runs=1, cpu_s=time.thread_time() - begun_s))


def _look(
    context: JobContext,
    camera_id: str,
    newest_pk: int | None,
    budget: RunBudget,
    *,
    asked: bool,
) -> RunKind:
    """Estimate from all tracks up to one. No transaction is open while anything is computed.

    Until a full estimate is due or `asked` for, new tracks update the monitor alone.

    Returns:
        The kind of this run.
    """
    store, settings = context.store, context.settings
    failures, unpacked = PartialFailures(camera_id), Unpacked(budget)
    finish = partial(_finish, context, camera_id, newest_pk, time.monotonic())
    if _monitor(context, camera_id, finish, unpacked, asked=asked):
        return RunKind.MONITOR
    if propose_if_uncalibrated(context, camera_id, unpacked):
        with store.write(camera_id) as session:
            finish(session, skipped_by(budget))
        return RunKind.FULL
    failures.unless_failed("picture", partial(compare_if_due, context, camera_id))
    missing = predict_pending(context, camera_id, unpacked)
    if missing:
        failures.add("averaged estimate", missing)
    if not learn_if_due(context, camera_id, unpacked):
        with store.write(camera_id) as session:
            finish(session, skipped_by(budget))
        return RunKind.FULL
    failures.unless_failed("anchor", partial(log_slow_drift_if_due, context, camera_id, unpacked))
    with store.read() as session:
        evidence = load_evidence(session, settings, camera_id, unpacked, asked=asked)
    if skipped := skipped_by(budget):
        log.warning("tracks_skipped", extra={"camera_id": camera_id, **skipped[0].values})
        failures.reasons.extend(skipped)
    found = None if evidence is None else compute_estimate(evidence, settings.seed, failures)
    with store.write(camera_id) as session:
        record = None
        if evidence is not None and isinstance(found, ComputedEstimate):
            record = save_estimate(session, context.queue, settings, evidence, found)
            _log_estimate(record)
            if record is not None:
                ask_in_doubt(session, record, evidence.picture)
        if found is None or (evidence is not None and evidence.site is None):
            _log_estimate(save_by_picture(session, settings, camera_id))
        if evidence is not None and found is not None and not skipped:
            save_monitor_state(session, evidence, found, record)
        cooling = context.growth_cooldown.failures_of(camera_id)
        finish(session, (*failures.reasons, *cooling))
    if isinstance(found, Monitored):
        return RunKind.MONITOR
    _grow_unless_failed(context, camera_id, unpacked)
    return RunKind.FULL


def _monitor(
    context: JobContext,
    camera_id: str,
    finish: Callable[[Session, Reasons], None],
    unpacked: Unpacked,
    *,
    asked: bool,
) -> bool:
    """Update the monitor by the new tracks alone; False if the whole window is needed."""
    store, settings = context.store, context.settings
    with store.read() as session:
        new = load_new_tracks(session, settings, camera_id, context.sites, unpacked, asked=asked)
    found = None if new is None else monitor_new_tracks(new)
    if found is None:
        return False
    with store.write(camera_id) as session:
        monitor_states.keep_newer(session, camera_id, found.basis, found.newer)
        finish(session, context.growth_cooldown.failures_of(camera_id))
    return True


def _finish(
    context: JobContext,
    camera_id: str,
    newest_pk: int | None,
    begun_s: float,
    session: Session,
    failures: Reasons,
) -> None:
    """Finish a run; the camera rests for a time in proportion to it."""
    rest_s = context.settings.estimate_rest * (time.monotonic() - begun_s)
    finish_run(session, camera_id, newest_pk, rest_s=rest_s, failures=failures)


def _log_estimate(record: EstimateRecord | None) -> None:
    if record is not None:
        fields = {"tracks": record.tracks, "state": record.state}
        log.info("estimate_stored", extra={"camera_id": record.camera_id, **fields})


def compare_if_due(context: JobContext, camera_id: str) -> None:
    """Compare a camera's newest picture with its gallery, where nobody has yet."""
    with context.store.read() as session:
        new = load_picture(session, context.settings, camera_id)
    if new is None:
        return
    compared = compare(new)
    with context.store.write(camera_id) as session:
        kept = save_picture(session, context.settings, new, compared)
    if kept:
        fields = {"matched": compared.record.offset is not None, "fault": compared.fault}
        log.info("picture_compared", extra={"camera_id": camera_id, **fields})


def propose_if_uncalibrated(context: JobContext, camera_id: str, unpacked: Unpacked) -> bool:
    """Have people tell the pose of a camera without a prior pose; False where it has one."""
    with context.store.read() as session:
        people = load_people(session, context.settings, camera_id, unpacked)
    if people is None:
        return False
    doubt = doubt_image_size(people.unstated, people.intrinsics, None)
    found = None if doubt is not None else compute_proposal(people)
    if found is not None or doubt is not None or people.doubted:
        with context.store.write(camera_id) as session:
            save_proposal(session, camera_id, people, found, doubt)
    if found is not None:
        log.info("pose_proposed", extra={"camera_id": camera_id, "tracks": len(people.tracks)})
    return True


def predict_pending(context: JobContext, camera_id: str, unpacked: Unpacked) -> str:
    """Have the model in use look at all tracks of the window that it has not seen.

    What it says is never served, so what fails here is logged and said, and stops nobody: returns
    why, or nothing. A model whose weights cannot be read is given up; the reconcile trains another.
    """
    try:
        _predict_all(context, camera_id, unpacked)
    except CheckpointError as error:
        log.error("weights_unreadable", extra={"camera_id": camera_id, "why": str(error)})
        return "the weights of its model cannot be read, and it is trained again"
    except Exception as error:
        log.exception("predictions_failed", extra={"camera_id": camera_id})
        return repr(error)
    return ""


def _predict_all(context: JobContext, camera_id: str, unpacked: Unpacked) -> None:
    while True:
        with context.store.read() as session:
            pending = load_pending(session, context.settings, camera_id, _BATCH, unpacked.budget)
        if pending is None or not pending.tracks:
            return
        fetch_weights(context.store, context.settings, pending.model.weights_sha256)
        from service.workers.regressor import predict  # torch: 200 MB that not every worker needs

        try:
            rows = predict(context.settings.weights_dir, pending, unpacked)
        except CheckpointError:
            with context.store.write(camera_id) as session:
                drop_model(session, pending.model.id)
            raise
        with context.store.write(camera_id) as session:
            save_predictions(session, pending.model.id, rows)


def learn_if_due(context: JobContext, camera_id: str, unpacked: Unpacked) -> bool:
    """Learn a camera's reference once there are enough tracks; False if they are in doubt.

    Nothing is learned or estimated from tracks that seem to be in pixels of another image, until
    the question about them is answered.
    """
    with context.store.read() as session:
        period = load_reference_period(session, context.settings, camera_id, unpacked)
    if period is None:
        return True
    doubt = doubt_image_size(period.unstated, period.intrinsics, period.prior)
    if doubt is not None or not period.enough:
        with context.store.write(camera_id) as session:
            save_progress(session, camera_id, period, doubt)
        return doubt is None
    learned = compute_reference(period, context.settings.seed)
    with context.store.write(camera_id) as session:
        save_reference(session, context.settings, camera_id, period, learned)
    log.info(
        "reference_learned" if learned else "reference_without_walkers",
        extra={"camera_id": camera_id, "tracks": len(period.trajectories)},
    )
    return True


def log_slow_drift_if_due(context: JobContext, camera_id: str, unpacked: Unpacked) -> None:
    """Hold the whole days that have come since the last time against a camera's anchor."""
    with context.store.read() as session:
        days = load_anchor_days(session, context.settings, camera_id, unpacked)
    if days is None:
        return
    logged = compute_anchor_days(days)
    with context.store.write(camera_id) as session:
        save_anchor_days(session, days, logged)
    fields = {"camera_id": camera_id, "tracks": len(days.trajectories)}
    log.info("slow_drift_logged", extra=fields)


def grow_if_due(context: JobContext, camera_id: str, unpacked: Unpacked) -> None:
    """Learn a camera's flow map anew, once enough tracks have come that are known to be still.

    A worker that dies here leaves the map as it was; the next job finds it due again.
    """
    with context.store.read() as session:
        period = load_growth(session, context.settings, camera_id, unpacked)
    if period is None:
        return
    begun_s = time.monotonic()
    learned = compute_growth(period, context.settings.seed)
    with context.store.write(camera_id) as session:
        grown = save_growth(session, camera_id, period, learned)
    context.growth_budget.spend(time.monotonic() - begun_s)
    if grown:
        fields = {"camera_id": camera_id, "tracks": len(period.trajectories)}
        log.info("flow_map_grown", extra=fields)


def _grow_unless_failed(context: JobContext, camera_id: str, unpacked: Unpacked) -> None:
    """Let the flow map grow; where that fails it stays as it was, for an hour at least."""
    if context.growth_cooldown.failures_of(camera_id):
        return
    if context.growth_budget.spent:
        with context.store.read() as session:
            if context.queue.estimates_wait(session, besides=camera_id):
                return  # the next job finds it due again
    failures = PartialFailures(camera_id)
    grow = partial(grow_if_due, context, camera_id, unpacked)
    with limited_effort(context.settings.estimate_cpu_s):
        failures.unless_failed("growth_of_the_flow_map", grow)
    if failures.reasons:
        failed = tuple(failures.reasons)
        context.growth_cooldown.begin(camera_id, failed)
        with context.store.write(camera_id) as session:
            note_partial_failures(session, camera_id, failed)
