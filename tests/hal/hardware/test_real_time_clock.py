"""Real time is kept, and periodic calls run in the thread that sleeps."""

from __future__ import annotations

import math
import threading
import time

import pytest

from hal.hardware import RealTimeClock

pytestmark = pytest.mark.real_time


def test_a_sleep_lasts_as_long_as_asked() -> None:
    clock = RealTimeClock()
    start, wall = clock.now(), time.monotonic()
    clock.sleep(0.1)
    assert clock.now() - start >= 0.1
    assert clock.now() - start == pytest.approx(time.monotonic() - wall, abs=0.01)


def test_what_a_sleep_lasted_too_long_shortens_the_next() -> None:
    clock = RealTimeClock()
    start = clock.now()
    for _ in range(200):
        clock.sleep(0.001)
    assert clock.now() - start < 0.2 + 0.05


def test_a_wake_up_ends_a_wait() -> None:
    clock, wake = RealTimeClock(), threading.Event()
    threading.Timer(0.05, wake.set).start()
    start = clock.now()
    clock.wait(5.0, wake)
    assert clock.now() - start < 1.0


def test_periodic_calls_run_in_the_thread_that_asked_for_them() -> None:
    clock = RealTimeClock()
    threads: set[int] = set()
    clock.every(0.01, lambda: threads.add(threading.get_ident()))
    other = threading.Thread(target=lambda: clock.sleep(0.1))
    other.start()
    other.join()
    assert threads == set()
    clock.sleep(0.05)
    assert threads == {threading.get_ident()}


def test_calls_that_were_missed_are_left_out() -> None:
    clock = RealTimeClock()
    times: list[float] = []
    clock.every(0.02, lambda: times.append(clock.now()))
    time.sleep(0.2)  # somebody computes
    clock.sleep(0.05)
    assert 1 <= len(times) <= 4


def test_a_periodic_call_may_not_sleep() -> None:
    clock = RealTimeClock()
    clock.every(0.01, lambda: clock.sleep(0.01))
    with pytest.raises(RuntimeError, match="periodic call"):
        clock.sleep(0.05)


def test_a_cancelled_timer_is_not_called_again() -> None:
    clock = RealTimeClock()
    calls: list[int] = []
    timer = clock.every(0.01, lambda: calls.append(1))
    clock.sleep(0.03)
    timer.cancel()
    before = len(calls)
    clock.sleep(0.03)
    assert len(calls) == before > 0


@pytest.mark.parametrize("period", [0.0, -1.0, math.inf, math.nan])
def test_impossible_periods_are_refused(period: float) -> None:
    with pytest.raises(ValueError, match="period"):
        RealTimeClock().every(period, lambda: None)
