"""A control loop keeps its rate, knows how late it was, and tells of its end."""

from __future__ import annotations

import threading
import time

import pytest

from hal.hardware import ControlLoop

pytestmark = pytest.mark.real_time


def test_it_is_called_at_its_rate_with_the_time_that_has_passed() -> None:
    elapsed: list[float] = []
    loop = ControlLoop("loop", 100.0, elapsed.append, lambda error: None)
    loop.start()
    time.sleep(0.5)
    assert loop.close()
    assert sum(elapsed) == pytest.approx(0.5, abs=0.2)
    assert 10 < len(elapsed) <= 100.0 * sum(elapsed) + 1
    assert loop.lateness().cycles == len(elapsed)


def test_a_call_that_takes_too_long_leaves_out_the_next_ones() -> None:
    calls: list[float] = []

    def slow(elapsed: float) -> None:
        calls.append(elapsed)
        time.sleep(0.05)

    loop = ControlLoop("loop", 100.0, slow, lambda error: None)
    loop.start()
    time.sleep(0.4)
    loop.close()
    assert len(calls) <= 9
    assert loop.lateness().missed >= 3 * (len(calls) - 1)


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
    assert told.wait(2.0)
    assert loop.close()
    assert [str(error) for error in errors] == ["no answer"]


def test_it_can_be_closed_from_within() -> None:
    loops: list[ControlLoop] = []
    loops.append(ControlLoop("loop", 100.0, lambda elapsed: loops[0].close() and None, lambda error: None))
    loops[0].start()
    time.sleep(0.1)
    assert loops[0].lateness().cycles == 1
