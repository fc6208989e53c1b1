"""What computes ends at its next compiled loop, once its thread has had its CPU time."""

import threading
import time

import pytest

from models.compiled import compiled
from models.effort import EffortExceededError, check_effort, limited_effort


@compiled
def twice(x):
    return 2 * x


def work(cpu_s):
    until_s = time.thread_time() + cpu_s
    while time.thread_time() < until_s:
        pass


def test_a_loop_is_the_end_of_what_has_had_its_time():
    assert twice(3.0) == 6.0
    with limited_effort(0.02):
        assert twice(3.0) == 6.0
        work(0.03)
        with pytest.raises(EffortExceededError):
            twice(3.0)
        with limited_effort(60.0):
            assert twice(3.0) == 6.0
        with pytest.raises(EffortExceededError):
            check_effort()
    assert twice(3.0) == 6.0


def test_others_work_and_waiting_are_not_counted():
    with limited_effort(0.05):
        beside = threading.Thread(target=work, args=(0.1,))
        beside.start()
        beside.join()
        time.sleep(0.06)
        assert twice(3.0) == 6.0
