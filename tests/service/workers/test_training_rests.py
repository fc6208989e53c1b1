"""A training that is in the way rests between two of its steps, and loses nothing by it."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from models.errors import CalibrationError
from models.regression import recipe
from models.regression.recipe import TrainingPlan, TrainingProgress
from models.simulation.walkers import WalkConfig
from service.job_queue import JobQueue
from service.store.engines.store import Store
from service.workers.context import JobContext
from service.workers.train import may_go_on, train_apart

_RESTS = 6  # ticks, each of half a second: no step of this training takes that long


@pytest.mark.nightly
def test_it_rests_while_it_may_not_go_on_and_its_limit_with_it(settings, lens, pose):
    fresh = replace(recipe.DEFAULT, start="fresh", learning_rate=0.002)
    small = replace(fresh, random_poses=256, walks_per_pose=2, epochs=4, batch=32)
    plan = TrainingPlan(intrinsics=lens, prior_pose=pose, recipe=small, walk=WalkConfig(), seed=0)
    settings.weights_dir.mkdir(parents=True, exist_ok=True)
    steps: list[int] = []
    rested: list[int] = []

    def may_go_on_now() -> bool:
        if not steps or len(rested) == _RESTS:
            return True
        rested.append(steps[-1])
        return False

    def note(told: TrainingProgress | None) -> None:
        if told is not None:
            steps.append(told.step)

    # So short a one comes to its end, and has learned too little there.
    with pytest.raises(CalibrationError, match="held-out check"):
        train_apart(plan, settings, note, may_go_on_now)
    # It was told while a step was under way: from then on there is none.
    assert rested[2:] == [rested[2]] * (_RESTS - 2)
    assert steps[-1] > rested[-1]


def test_what_waits_for_a_worker_goes_first(settings):
    store = Store(settings)
    context = JobContext(settings=settings, store=store, queue=JobQueue(store.engine))
    always = replace(context, settings=settings.model_copy(update={"trainings": "on"}))
    assert settings.trainings == "idle"
    assert may_go_on(context)
    with store.write() as session:
        context.queue.enqueue_estimate(session, "corner", datetime.now(UTC))
    assert not may_go_on(context)
    assert may_go_on(always)
    context.queue.close()
    store.close()
