"""Checks of the clock."""

from __future__ import annotations

import math
from itertools import pairwise

from hal.api import Robot
from hal.conformance.subject import Check, ConformanceError, require, waits_for_sleeps


def sleeping_takes_the_time_asked(robot: Robot) -> None:
    """Check that many short sleeps take as long as a long one.

    If time passes only in sleeps: within one time step. Otherwise: never less, and in at least one of three tries not
    more, because a busy machine wakes up late.
    """
    if waits_for_sleeps(robot.clock):
        passed, step = _short_sleeps(robot)
        words = f"100 sleeps of 3.3 ms should take 0.33 s but took {passed:.4f} s, in steps of {step:.4f} s"
        require(abs(passed - 0.33) <= min(step, 0.02) + 1e-6, words)
        return
    tries = []
    for _ in range(3):
        tries.append(_short_sleeps(robot)[0])
        waits_for_sleeps(robot.clock)  # so that what one try took too long is not missing in the next
    right = 0.31 <= min(tries) <= 0.36
    require(right, f"100 sleeps of 3.3 ms should take 0.33 s but took {', '.join(f'{t:.4f} s' for t in tries)}")


def time_never_goes_back(robot: Robot) -> None:
    """Check that the clock is monotonic and advances while the robot sleeps."""
    times = [robot.clock.now()]
    for _ in range(50):
        robot.clock.sleep(0.004)
        times += [robot.clock.now(), robot.clock.now()]
    back = min(after - before for before, after in pairwise(times))
    require(back >= 0.0, f"time went back by {-back:.6f} s")
    require(times[-1] - times[0] > 0.19, f"50 sleeps of 4 ms took {times[-1] - times[0]:.4f} s")


def impossible_sleeps_are_refused(robot: Robot) -> None:
    """Check that negative, infinite and not-a-number durations are refused."""
    for duration in (-0.1, math.inf, math.nan):
        try:
            robot.clock.sleep(duration)
        except ValueError:
            continue
        raise ConformanceError(f"sleep({duration}) should raise ValueError")


def periodic_calls_come_on_time(robot: Robot) -> None:
    """Check a periodic call at 10 Hz: never early, and not after the timer is cancelled.

    On a robot in real time, in at least one of three attempts, because a busy machine calls late.
    """
    for _ in range(1 if waits_for_sleeps(robot.clock) else 3):
        wrong = _wrong_with_periodic_calls(robot)
        if not wrong:
            return
    raise ConformanceError(wrong)


def _wrong_with_periodic_calls(robot: Robot) -> str:
    times: list[float] = []
    start = robot.clock.now()
    timer = robot.clock.every(0.1, lambda: times.append(robot.clock.now() - start))
    robot.clock.sleep(1.05)
    timer.cancel()
    timer.cancel()
    robot.clock.sleep(0.3)
    if len(times) != 10:
        return f"a timer of 0.1 s should be called 10 times in 1.05 s but was called {len(times)} times"
    late = [time - 0.1 * (k + 1) for k, time in enumerate(times)]
    if min(late) >= -1e-6 and max(late) < 0.05:
        return ""
    return f"periodic calls were off by {min(late):.4f} to {max(late):.4f} s"


def _short_sleeps(robot: Robot) -> tuple[float, float]:
    """Return how long 100 sleeps of 3.3 ms took, and the longest of them, seconds."""
    times = [robot.clock.now()]
    for _ in range(100):
        robot.clock.sleep(0.0033)
        times.append(robot.clock.now())
    return times[-1] - times[0], max(after - before for before, after in pairwise(times))


CLOCK_CHECKS = (
    Check(sleeping_takes_the_time_asked),
    Check(time_never_goes_back),
    Check(impossible_sleeps_are_refused),
    Check(periodic_calls_come_on_time),
)
