"""PID control of one quantity.

K. J. Åström and R. M. Murray, "Feedback Systems", 2nd ed. 2021, chapter 11: back-calculation against windup (11.4),
derivative of the filtered measurement instead of the error, setpoint weighting (11.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class PIDParameters:
    """Units are those of the output per unit of the error, and per second or second where ``ki`` or ``kd``.

    ``lower``, ``upper``: of the output. ``tracking_time``: seconds in which the integral lets go of what the limits
    cut off (back-calculation); None clamps instead: the integral stops while it would only push further beyond a
    limit. ``derivative_filter``: time constant of the first-order low-pass before the derivative, seconds.
    ``setpoint_weight``: how much of the setpoint the proportional part sees; below 1 it overshoots less.
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    tracking_time: float | None = None
    derivative_filter: float = 0.0
    setpoint_weight: float = 1.0

    def __post_init__(self) -> None:
        for name in ("kp", "ki", "kd", "derivative_filter"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"PID {name} should be at least 0, got {getattr(self, name)}")
        if not self.lower < self.upper:
            raise ValueError(f"PID lower = {self.lower} should be below upper = {self.upper}")
        if self.tracking_time is not None and not self.tracking_time > 0.0:
            raise ValueError(f"PID tracking_time should be above 0 seconds, got {self.tracking_time}")


class PID:
    """A controller with limits that does not wind up; call ``update`` once per period."""

    def __init__(self, parameters: PIDParameters) -> None:
        self._parameters = parameters
        self._integral = 0.0
        self._filtered: float | None = None

    @property
    def integral(self) -> float:
        """The integral part of the output."""
        return self._integral

    def reset(self, integral: float = 0.0) -> None:
        """Forget what was; ``integral``: an output to begin with, so that taking over from others does not bump."""
        self._integral, self._filtered = integral, None

    def update(self, setpoint: float, measurement: float, period: float) -> float:
        """The output, within the limits, ``period`` seconds (> 0) after the call before."""
        p, error = self._parameters, setpoint - measurement
        wanted = (
            p.kp * (p.setpoint_weight * setpoint - measurement)
            + self._integral
            - p.kd * self._rate(measurement, period)
        )
        output = min(max(wanted, p.lower), p.upper)
        step = p.ki * error * period
        if p.tracking_time is not None:
            self._integral += step + (output - wanted) * min(1.0, period / p.tracking_time)
        elif output == wanted or (wanted - output) * step < 0.0:
            self._integral += step
        return output

    def _rate(self, measurement: float, period: float) -> float:
        """Of the filtered measurement, per second; by backward differences, stable for any period."""
        before = self._filtered
        if before is None:
            self._filtered = measurement
            return 0.0
        time = self._parameters.derivative_filter
        self._filtered = before + period / (time + period) * (measurement - before)
        return (self._filtered - before) / period
