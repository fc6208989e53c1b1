"""A look that has too much to do goes on without the tracks that are to blame, and says so."""

from functools import partial

import numpy as np
import pytest
from sqlalchemy import update

from models.effort import EffortExceededError
from service.alerts.staleness import StaleWatch
from service.estimate_queue import budget_of
from service.store import run_budget, windows
from service.store.cameras import CameraRecord
from service.store.run_budget import RunBudget, TrackSize
from service.store.windows import WindowBounds
from service.workers.estimate import run_estimate
from tests.service.street import KNOCKED, known_street

WANTED = 60


@pytest.fixture
def street(learned):
    """A camera whose reference is learned."""
    return learned("look-budget", partial(known_street, people=WANTED))


def linger(street, count):
    """Post people who stay for an hour, with a point each 8 s: 2,400 nodes of each."""
    street.clock_s += 3_600.0
    time_s = street.clock_s - 3_600.0 + 8.0 * np.arange(450)
    rows = np.column_stack([time_s, np.full((450, 2), 300.0)])
    tracks = [{"id": f"lingers {n}", "points": rows.tolist()} for n in range(count)]
    answer = street.http.post("/cameras/corner/tracks", json={"tracks": tracks})
    assert answer.json()["accepted"] == count


def camera(street):
    with street.context.store.read() as session:
        return session.get_one(CameraRecord, "corner")


def watch(street):
    with street.context.store.write() as session:
        return StaleWatch().watch(session, street.context.settings)


def budget(street):
    with street.context.store.read() as session:
        return budget_of(session, "corner")


def spoil(street, **values):
    with street.context.store.write() as session:
        session.execute(update(CameraRecord).values(**values))


def test_the_largest_are_skipped_and_no_more_of_them_than_need_be():
    def size(number, duration_s, points=500, stored=12_000):
        return TrackSize(number, f"t{number}", duration_s, points, stored)

    honest = [size(n, 30.0) for n in range(400)]
    lingering = [size(500 + n, 3_000.0 + 2 * n) for n in range(9)]
    budget = RunBudget()
    assert budget.leave_out(honest) == []
    assert budget.leave_out([*honest, *lingering]) == [508]
    assert budget.skipped == {n: f"t{n}" for n in (508,)}
    large = [size(1, 30.0, 10_000, 80_000_000), size(2, 30.0, 10_000, 40_000_000)]
    assert RunBudget().leave_out(large) == [1]
    assert RunBudget(0.25).leave_out(large) == [1, 2]
    # Six points over a month are 34 nodes, however they got there.
    assert RunBudget().leave_out([size(n, 30 * 86_400.0, 6, 144) for n in range(700)]) == []


def test_of_what_is_left_out_the_last_point_is_read_and_it_counts(street):
    linger(street, 2)
    bounds = WindowBounds(camera_id="corner", tracks=10, days=7.0)
    with street.context.store.read() as session:
        whole = windows.window(session, bounds)
        some = windows.window(session, bounds, RunBudget(0.1))
    assert [record.id for record in some] == [record.id for record in whole]
    assert [len(record.points) // 24 for record in whole[-2:]] == [450, 450]
    cut = [record for record in some if len(record.points) == 24]
    assert [record.points for record in cut] == [
        record.points[-24:] for record in whole if record.id in {each.id for each in cut}
    ]
    assert 1 <= len(cut) <= 2


def test_a_camera_beside_whom_people_linger_sees_a_knock_and_names_them(street, monkeypatch):
    monkeypatch.setattr(run_budget, "_MOST_ROWS", 6_000)
    linger(street, 9)
    street.keep_to_lanes(KNOCKED, 40)
    body = street.look()
    assert body["drift"]["tilt_deg"] == pytest.approx(5.0, abs=1.5)
    assert "7 of its tracks are not looked at" in body["reason"]
    assert watch(street) == {"corner": "opened"}
    (alert,) = (each for each in street.alerts() if each["kind"] == "stale")
    assert (alert["severity"], alert["reason_code"]) == ("warning", "tracks_skipped")
    assert "'lingers 0', 'lingers 1'" in alert["reason"]
    assert watch(street) == {}
    # Then the looks fail, too: the same alert, and critical.
    spoil(street, estimate_tries=3, estimate_error="x", estimate_due_at=camera(street).updated_at)
    watch(street)
    (alert,) = (each for each in street.alerts() if each["kind"] == "stale")
    assert (alert["severity"], alert["reason_code"]) == ("critical", "looks_fail")
    spoil(street, estimate_due_at=None, estimate_tries=0)
    monkeypatch.undo()
    street.keep_to_lanes(KNOCKED, 5)
    street.look()
    assert camera(street).missing_parts == ()
    assert watch(street) == {"corner": "ended"}


def test_a_look_that_takes_too_long_ends_and_the_next_ones_leave_more_out(street):
    linger(street, 9)
    street.keep_to_lanes(KNOCKED, 40)
    context = street.context
    hasty = context.settings.model_copy(update={"estimate_cpu_s": 1e-3})
    street.go_on(street.http, hasty)
    for _ in range(2):
        with pytest.raises(EffortExceededError):
            run_estimate(street.context, "corner")
        assert camera(street).estimate_error.startswith("EffortExceededError")
        spoil(street, estimate_after=None)
    street.go_on(street.http, context.settings)
    assert street.look()["drift"]["tilt_deg"] == pytest.approx(5.0, abs=1.5)
    (lack,) = camera(street).missing_parts
    assert lack.values["share"] == 0.0625
    assert lack.values["tracks"] >= 8
    assert budget(street).share == 0.0625  # as long as they are there


def test_a_worker_that_died_of_a_camera_makes_the_budget_smaller(street):
    assert budget(street).share == 1.0
    spoil(street, estimate_tries=1, estimate_error="OperationalError('locked')")
    assert budget(street).share == 1.0
    spoil(street, estimate_tries=3, estimate_error="MemoryError('Allocation failed')")
    assert budget(street).share == 0.0625
