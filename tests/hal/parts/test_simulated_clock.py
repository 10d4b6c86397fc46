"""Simulated time goes in whole physics steps and loses nothing between them."""

from __future__ import annotations

import pytest

from hal.api import NotConnectedError
from hal.parts.simulated_clock import SimulatedClock

STEP = 1.0 / 240.0


@pytest.fixture
def clock() -> SimulatedClock:
    clock = SimulatedClock(STEP)
    clock.step = lambda: None
    return clock


def test_remainders_of_short_sleeps_carry_over(clock) -> None:
    for _ in range(1000):
        clock.sleep(0.001)
    assert clock.now() == pytest.approx(1.0, abs=STEP)


def test_a_sleep_of_a_whole_number_of_steps_takes_exactly_these(clock) -> None:
    for _ in range(20):
        clock.sleep(0.05)
    assert clock.now() == pytest.approx(1.0, abs=1e-9)


def test_timers_run_in_the_order_of_their_making_at_the_step_when_they_are_due(clock) -> None:
    calls = []
    clock.every(0.1, lambda: calls.append(("first", round(clock.now(), 4))))
    clock.every(0.05, lambda: calls.append(("second", round(clock.now(), 4))))
    clock.sleep(0.1)
    assert calls == [("second", 0.05), ("first", 0.1), ("second", 0.1)]


def test_a_timer_that_cancels_itself_is_not_called_again(clock) -> None:
    calls = []

    def call() -> None:
        calls.append(clock.now())
        timer.cancel()

    timer = clock.every(0.01, call)
    clock.sleep(0.1)
    assert len(calls) == 1


def test_sleeping_inside_a_periodic_call_is_refused(clock) -> None:
    clock.every(0.01, lambda: clock.sleep(0.1))
    with pytest.raises(RuntimeError, match="periodic call"):
        clock.sleep(0.1)
    clock.cancel_timers()
    clock.sleep(0.1)


def test_time_does_not_pass_without_a_connection() -> None:
    clock = SimulatedClock(STEP)
    with pytest.raises(NotConnectedError, match="not connected"):
        clock.sleep(0.1)
    assert clock.now() == 0.0


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_impossible_periods_are_refused(clock, period) -> None:
    with pytest.raises(ValueError, match="period"):
        clock.every(period, lambda: None)
