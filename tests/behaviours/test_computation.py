from __future__ import annotations

import pytest

from behaviours.computation import InlineComputation
from bestman_bt.engine import ManualClock


def test_a_result_is_delivered_when_its_cost_has_passed_on_the_robots_clock() -> None:
    clock = ManualClock(10.0)
    job = InlineComputation(clock).submit(lambda: 42, cost=0.25)
    clock.advance(0.24)
    assert not job.done
    clock.advance(0.01)
    assert job.done
    assert job.result() == 42


def test_an_exception_is_kept_until_the_result_is_taken() -> None:
    clock = ManualClock()

    def fail() -> None:
        raise ValueError("no solution")

    job = InlineComputation(clock).submit(fail, cost=0.1)
    clock.advance(0.1)
    assert job.done
    with pytest.raises(ValueError, match="no solution"):
        job.result()


def test_a_cancelled_computation_stays_quiet() -> None:
    clock = ManualClock()
    job = InlineComputation(clock).submit(lambda: 42, cost=0.1)
    job.cancel()
    job.cancel()
    assert not job.done
