"""A straight drive or a turn on the spot by odometry: the velocity that brings it to its end."""

from __future__ import annotations

import math

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from bestman_bt.robot_model import BaseModel

ARRIVED = 0.002
HEADING_GAIN = 2.0
BRAKING_SHARE = 1.4
"""Below 2, the share of a full braking from which the speed is planned: it leaves room for the base's lag."""
APPROACH_RATE = 4.0


class Course:
    """``distance`` metres ahead (negative: back) or ``turn`` radians (counter-clockwise), from ``start``."""

    def __init__(self, model: BaseModel, start: Pose2D, *, distance: float = 0.0, turn: float = 0.0) -> None:
        self._model, self._start, self._distance, self._turn = model, start, distance, turn
        self._heading, self._turned = start.theta, 0.0
        self._remaining = turn or distance
        if turn:
            limit, acceleration = model.max_wz, model.max_angular_acceleration
        else:
            limit, acceleration = model.max_vx, model.max_acceleration
        self._limit, self._acceleration = limit, acceleration
        self._time_left = 2.0 * (abs(self._remaining) / limit + limit / acceleration) + 3.0
        self._near_for = 0.0
        self.arrived = turn == 0.0 and distance == 0.0

    @property
    def overdue(self) -> bool:
        """Whether it takes twice as long as it should."""
        return self._time_left < 0.0

    def remainder(self) -> str:
        """What is left, in words."""
        return f"{self._remaining:.3f} {'rad' if self._turn else 'm'} are left when they should be done"

    def velocity(self, odometry: Pose2D, elapsed: float) -> Twist2D:
        """What to drive at, ``elapsed`` seconds after the last call."""
        self._time_left -= elapsed
        self._turned += wrap_angle(odometry.theta - self._heading)
        self._heading = odometry.theta
        if self._turn:
            self._remaining = self._turn - self._turned
        else:
            self._remaining = self._distance - (self._start.inverse() @ odometry).x
        self._near_for = self._near_for + elapsed if abs(self._remaining) < ARRIVED else 0.0
        self.arrived = self._near_for > 0.1
        stopping = math.sqrt(BRAKING_SHARE * self._acceleration * abs(self._remaining))
        speed = math.copysign(min(self._limit, stopping, APPROACH_RATE * abs(self._remaining)), self._remaining)
        if self._turn:
            return Twist2D(0.0, 0.0, speed)
        steer = max(-self._model.max_wz, min(self._model.max_wz, -HEADING_GAIN * self._turned))
        return Twist2D(speed, 0.0, steer)
