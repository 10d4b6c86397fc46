"""Real time is kept, and periodic calls run in the thread that sleeps; by a scripted clock of the machine."""

from __future__ import annotations

import math
import threading

import pytest

import hal.hardware.clock
from hal.hardware.clock import RealTimeClock
from tests.hal.hardware.scripted_time import Machine


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine().in_place_of_time(hal.hardware.clock, monkeypatch)


def test_it_begins_at_zero_or_where_another_process_began(machine: Machine) -> None:
    assert RealTimeClock().now() == 0.0
    assert RealTimeClock(48.0).now() == 2.0


def test_a_sleep_lasts_as_long_as_asked(machine: Machine) -> None:
    clock = RealTimeClock()
    clock.sleep(0.1)
    assert clock.now() == pytest.approx(0.1)


def test_a_sleep_by_the_machines_own_clock_is_not_shorter_than_asked() -> None:
    clock = RealTimeClock()
    start = clock.now()
    clock.sleep(0.02)
    assert clock.now() - start >= 0.02


def test_what_a_sleep_lasted_too_long_shortens_the_next(machine: Machine) -> None:
    clock = RealTimeClock()
    machine.late = 0.0004
    for _ in range(200):
        clock.sleep(0.001)
    assert clock.now() == pytest.approx(0.2, abs=0.001)


@pytest.mark.parametrize(
    ("late", "computed", "expected"),
    [
        (0.01, 0.0, 0.1),  # made up for
        (0.044, 0.004, 0.1),
        (0.01, 0.006, 0.116),  # it did something else meanwhile: no more than asked for
        (0.06, 0.0, 0.16),  # too long to be made up for
    ],
)
def test_only_a_short_delay_is_made_up_for_and_only_at_once(
    machine: Machine, late: float, computed: float, expected: float
) -> None:
    """Two sleeps of 50 and of 50 ms plus the debt; the first is late."""
    clock = RealTimeClock()
    machine.late = late
    clock.sleep(0.05)
    machine.late, machine.time = 0.0, machine.time + computed
    clock.sleep(0.05)
    assert clock.now() == pytest.approx(max(expected, 0.05 + late + computed), abs=1e-4)


def test_a_wake_up_ends_a_wait() -> None:
    clock, wake = RealTimeClock(), threading.Event()
    threading.Timer(0.02, wake.set).start()
    clock.wait(600.0, wake)
    assert clock.now() < 600.0


def test_periodic_calls_run_in_the_thread_that_asked_for_them() -> None:
    clock = RealTimeClock()
    threads: set[int] = set()
    clock.every(0.01, lambda: threads.add(threading.get_ident()))
    other = threading.Thread(target=lambda: clock.sleep(0.03))
    other.start()
    other.join()
    assert threads == set()
    clock.sleep(0.03)
    assert threads == {threading.get_ident()}


def test_periodic_calls_come_at_their_times_and_those_that_were_missed_are_left_out(machine: Machine) -> None:
    clock = RealTimeClock()
    times: list[float] = []
    clock.every(0.02, lambda: times.append(round(clock.now(), 3)))
    clock.sleep(0.05)
    assert times == [0.02, 0.04]
    machine.time += 0.15  # somebody computes
    clock.sleep(0.05)
    assert times == [0.02, 0.04, 0.2, 0.22, 0.24]


def test_a_periodic_call_may_not_sleep(machine: Machine) -> None:
    clock = RealTimeClock()
    timer = clock.every(0.01, lambda: clock.sleep(0.01))
    with pytest.raises(RuntimeError, match="periodic call"):
        clock.sleep(0.05)
    timer.cancel()
    clock.sleep(0.05)  # and it sleeps again afterwards


@pytest.mark.parametrize("end", ["cancel", "disconnect"])
def test_a_cancelled_timer_is_not_called_again(machine: Machine, end: str) -> None:
    clock = RealTimeClock()
    calls: list[int] = []
    timer = clock.every(0.01, lambda: calls.append(1))
    clock.sleep(0.035)
    timer.cancel() if end == "cancel" else clock.cancel_timers()
    clock.sleep(0.03)
    assert len(calls) == 3


@pytest.mark.parametrize("period", [0.0, -1.0, math.inf, math.nan])
def test_impossible_periods_are_refused(period: float) -> None:
    with pytest.raises(ValueError, match="period"):
        RealTimeClock().every(period, lambda: None)


@pytest.mark.parametrize("duration", [-0.1, math.inf, math.nan])
def test_impossible_sleeps_are_refused(duration: float) -> None:
    with pytest.raises(ValueError, match="sleep duration"):
        RealTimeClock().sleep(duration)
