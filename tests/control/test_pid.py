"""PID on plants whose answers are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.control import PID, PIDParameters

PERIOD = 0.01


def first_order(pid: PID, setpoint: float, seconds: float, time_constant: float = 0.5) -> np.ndarray:
    """The answer of x' = (u - x) / T, which begins at 0."""
    x, values = 0.0, []
    for _ in range(round(seconds / PERIOD)):
        x += PERIOD * (pid.update(setpoint, x, PERIOD) - x) / time_constant
        values.append(x)
    return np.array(values)


def test_the_proportional_part_alone_leaves_the_known_error() -> None:
    values = first_order(PID(PIDParameters(kp=4.0)), 1.0, 5.0)
    assert values[-1] == pytest.approx(4.0 / 5.0, abs=1e-6)


def test_the_integral_takes_the_error_away() -> None:
    values = first_order(PID(PIDParameters(kp=4.0, ki=8.0)), 1.0, 5.0)
    assert values[-1] == pytest.approx(1.0, abs=1e-4)


def overshoot_after_saturation(tracking_time: float | None, winds_up: bool = False) -> float:
    """A plant that can only follow half as fast as asked for a while: the limit is just above what is needed."""
    limits = {} if winds_up else {"lower": -1.2, "upper": 1.2}
    pid, x, highest = PID(PIDParameters(kp=4.0, ki=8.0, tracking_time=tracking_time, **limits)), 0.0, 0.0
    for _ in range(1000):
        output = min(max(pid.update(1.0, x, PERIOD), -1.2), 1.2)
        x += PERIOD * (output - x) / 0.5
        highest = max(highest, x)
    return highest - 1.0


@pytest.mark.parametrize("tracking_time", [None, 0.1])
def test_neither_clamping_nor_back_calculation_winds_up(tracking_time: float | None) -> None:
    assert overshoot_after_saturation(None, winds_up=True) > 0.1  # a controller that does not know the limit
    assert overshoot_after_saturation(tracking_time) < 0.02


def test_a_saturated_integral_is_ready_to_turn_back_at_once() -> None:
    for tracking_time in (None, 0.1):
        pid = PID(PIDParameters(kp=1.0, ki=10.0, lower=-1.0, upper=1.0, tracking_time=tracking_time))
        for _ in range(1000):
            assert pid.update(10.0, 0.0, PERIOD) == 1.0
        outputs = [pid.update(-1.0, 0.0, PERIOD) for _ in range(100)]
        assert outputs[2] < 0.0


def test_a_step_of_the_setpoint_does_not_kick_the_derivative() -> None:
    pid = PID(PIDParameters(kp=0.0, kd=1.0))
    pid.update(0.0, 0.5, PERIOD)
    assert pid.update(100.0, 0.5, PERIOD) == 0.0


def test_the_derivative_works_against_the_measurement_and_is_filtered() -> None:
    ramp = [0.3 * PERIOD * k for k in range(300)]
    for time in (0.0, 0.2):
        pid = PID(PIDParameters(kp=0.0, kd=2.0, derivative_filter=time))
        outputs = [pid.update(0.0, value, PERIOD) for value in ramp]
        assert outputs[-1] == pytest.approx(-0.6, rel=1e-3)
        after = sum(output > -0.6 * (1 - math.exp(-1)) for output in outputs) * PERIOD
        assert after == pytest.approx(time, abs=0.02)


def test_a_reset_takes_over_without_a_bump() -> None:
    pid = PID(PIDParameters(kp=2.0, ki=1.0))
    pid.reset(integral=0.7)
    assert pid.update(1.0, 1.0, PERIOD) == pytest.approx(0.7)


def test_a_smaller_setpoint_weight_overshoots_less() -> None:
    heavy = first_order(PID(PIDParameters(kp=4.0, ki=60.0)), 1.0, 3.0)
    light = first_order(PID(PIDParameters(kp=4.0, ki=60.0, setpoint_weight=0.2)), 1.0, 3.0)
    assert light.max() < heavy.max() - 0.05


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"kp": -1.0}, "kp"),
        ({"kp": 1.0, "ki": -1.0}, "ki"),
        ({"kp": 1.0, "kd": math.nan}, "kd"),
        ({"kp": 1.0, "derivative_filter": -0.1}, "derivative_filter"),
        ({"kp": 1.0, "lower": 1.0, "upper": 1.0}, "lower"),
        ({"kp": 1.0, "tracking_time": 0.0}, "tracking_time"),
    ],
)
def test_parameters_that_mean_nothing_are_refused(fields: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        PIDParameters(**fields)


def test_after_a_reset_the_derivative_begins_anew() -> None:
    pid = PID(PIDParameters(kp=0.0, kd=1.0, derivative_filter=0.1))
    for _ in range(3):
        pid.update(0.0, 5.0, PERIOD)
    pid.reset()
    assert pid.update(0.0, 0.0, PERIOD) == 0.0
    assert pid.integral == 0.0


def test_a_saturated_controller_without_tracking_still_integrates_towards_its_limits() -> None:
    pid = PID(PIDParameters(kp=1.0, ki=1.0, lower=-1.0, upper=1.0))
    pid.reset(integral=5.0)
    for _ in range(10):
        assert pid.update(-1.0, 0.0, PERIOD) == 1.0
    assert pid.integral == pytest.approx(5.0 - 10 * PERIOD)
    pid.update(9.0, 0.0, PERIOD)
    assert pid.integral == pytest.approx(5.0 - 10 * PERIOD), "it would only push further beyond the limit"
