"""A control loop keeps its rate, knows how late it was, and tells of its end."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

import hal.hardware.control_loop
from hal.hardware.control_loop import ControlLoop
from tests.hal.hardware.scripted_time import Machine

PERIOD = 0.01


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    return Machine(late=0.001).in_place_of_time(hal.hardware.control_loop, monkeypatch)


def run(machine: Machine, cycles: int, work: Callable[[int], float]) -> tuple[ControlLoop, list[float]]:
    """The loop after so many cycles, and what each was told; ``work``: periods that a cycle takes, by its number."""
    told: list[float] = []
    done = threading.Event()

    def step(elapsed: float) -> None:
        machine.time += work(len(told)) * PERIOD
        told.append(elapsed)
        if len(told) == cycles:
            loop.close()
            done.set()

    loop = ControlLoop("loop", 1.0 / PERIOD, step, lambda error: None)
    loop.start()
    assert done.wait(60.0)
    assert loop.close(60.0)
    return loop, told


def test_it_is_called_at_its_rate_with_the_time_that_has_passed(machine: Machine) -> None:
    start = machine.time
    loop, told = run(machine, 50, lambda number: 0.0)
    assert sum(told) == pytest.approx(machine.time - start)
    assert machine.time - start == pytest.approx(50 * PERIOD + machine.late)  # lateness does not add up
    late = loop.lateness()
    assert (late.cycles, late.missed) == (50, 0)
    assert late.median == late.worst == pytest.approx(machine.late)
    loop.forget_lateness()
    assert loop.lateness().cycles == 0


@pytest.mark.parametrize(("work", "missed"), [(0.3, 0), (0.95, 0), (1.5, 0), (2.5, 1), (5.5, 4)])
def test_a_call_that_takes_too_long_leaves_out_those_that_it_ran_over(
    machine: Machine, work: float, missed: int
) -> None:
    """``work``: of the first call, in periods. A short delay is made up for, a longer one is not."""
    machine.late, start = 0.0, machine.time
    loop, told = run(machine, 10, lambda number: 0.1 if number else work)
    assert loop.lateness().missed == missed
    loop.forget_lateness()
    assert loop.lateness().missed == 0
    assert machine.time - start == pytest.approx((10 + missed + 0.1) * PERIOD)
    assert told[1] == pytest.approx(max(work, 1.0) * PERIOD)


def test_an_error_ends_it_and_is_handed_on() -> None:
    errors: list[Exception] = []
    told = threading.Event()

    def crashed(error: Exception) -> None:
        errors.append(error)
        told.set()

    def fail(elapsed: float) -> None:
        raise ValueError("no answer")

    loop = ControlLoop("loop", 100.0, fail, crashed)
    loop.start()
    assert told.wait(60.0)
    assert loop.close(60.0)
    assert [str(error) for error in errors] == ["no answer"]


def test_it_can_be_closed_from_within_and_started_again() -> None:
    calls: list[float] = []
    called = threading.Event()

    def step(elapsed: float) -> None:
        calls.append(elapsed)
        loop.close()
        called.set()

    loop = ControlLoop("loop", 100.0, step, lambda error: None)
    for count in (1, 2):
        called.clear()
        loop.start()
        assert called.wait(60.0)
        assert loop.close(60.0)
        assert len(calls) == count
    assert loop.lateness().cycles == 2
