"""What skills wait for beside motions of the robot: computations, and conditions."""

from __future__ import annotations

import pytest

from behaviours.computation import InlineComputation, Until, passed
from bestman_bt.engine import ManualClock
from bestman_bt.messages import MotionErrorCode
from hal.api import Motion, MotionStatus


def test_a_result_is_delivered_when_its_cost_has_passed_on_the_robots_clock() -> None:
    clock = ManualClock(10.0)
    computed = InlineComputation(clock).submit(lambda: 42, cost=0.25)
    clock.advance(0.24)
    assert (computed.done, computed.result) == (False, None)
    clock.advance(0.01)
    assert (computed.status, computed.result) == (MotionStatus.SUCCEEDED, 42)


def test_an_exception_is_kept_until_the_result_is_taken() -> None:
    clock = ManualClock()

    def fail() -> None:
        raise ValueError("no solution")

    computed = InlineComputation(clock).submit(fail, cost=0.1)
    assert computed.result is None
    clock.advance(0.1)
    assert (computed.status, str(computed.failure)) == (MotionStatus.FAILED, "no solution")
    with pytest.raises(ValueError, match="no solution"):
        _ = computed.result


def test_a_cancelled_computation_delivers_nothing() -> None:
    clock = ManualClock()
    computed = InlineComputation(clock).submit(lambda: 42, cost=0.1)
    computed.cancel()
    clock.advance(0.2)
    assert (computed.status, computed.result) == (MotionStatus.CANCELED, None)


def test_waiting_ends_with_time_and_the_motion_goes_on() -> None:
    clock, motion = ManualClock(), Motion[int]("base")
    waiting = Until(passed(clock, 0.2), motion)
    clock.advance(0.19)
    assert not waiting.done
    clock.advance(0.02)
    assert (waiting.status, motion.status) == (MotionStatus.SUCCEEDED, MotionStatus.RUNNING)


def test_waiting_ends_well_with_a_motion_that_fails() -> None:
    motion = Motion[int]("base")
    waiting = Until(lambda: False, motion)
    assert not waiting.done
    motion.fail(MotionErrorCode.BLOCKED, "a chair")
    assert (waiting.status, waiting.failure) == (MotionStatus.SUCCEEDED, None)


@pytest.mark.parametrize("holds", [False, True])
def test_to_cancel_waiting_is_to_cancel_the_motion_whether_the_condition_holds_by_now_or_not(holds: bool) -> None:
    motion = Motion[int]("base")
    Until(lambda: holds, motion).cancel()
    assert motion.status is MotionStatus.CANCELED


def test_what_a_condition_said_first_stays() -> None:
    said = iter([False, True, False])
    waiting = Until(lambda: next(said))
    assert not waiting.done
    assert waiting.done
    assert waiting.done
