"""What a ROS robot's drivers do with velocities and set-points, over parts of the twins' world."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Twist2D
from hal.api import JointGroup, MobileBase
from hal.twins.world import TwinWorld

Array = NDArray[np.float64]
TRACKING_GAIN = 20.0
"""Per second: how hard a trajectory controller pulls joints to where they should be."""
AT_GOAL = 1e-5
"""Radians or metres: joints nearer to their goal are held in position; from farther away that would be a jolt."""
ROLLING_WINDOW = 5
"""Readings of which a base tells the mean velocity, as ``velocity_rolling_window_size`` of diff_drive_controller."""


class TwinBase:
    """Takes ``Twist`` and ``TwistStamped``, clipped to the base's limits; its dead-man ends velocities that age."""

    def __init__(self, world: TwinWorld, base: MobileBase) -> None:
        self._world, self.base = world, base
        self._velocities: deque[Twist2D] = deque(maxlen=ROLLING_WINDOW)
        self.stuck = False

    def drive(self, message: Mapping[str, Any]) -> None:
        """A velocity has come; from any thread."""
        twist = message.get("twist", message)
        asked = [float(twist["linear"]["x"]), float(twist["linear"]["y"]), float(twist["angular"]["z"])]
        if not np.all(np.isfinite(asked)):
            raise ValueError(f"a velocity should be finite but is {asked}")
        limits = self.base.model.part
        most = np.array([limits.max_vx, limits.max_vy, limits.max_wz])
        velocity = (np.clip(asked, -most, most) * (not self.stuck)).tolist()
        self._world.post(lambda: self.base.set_velocity(*velocity))

    def mean_velocity(self) -> Twist2D:
        """Of the last readings, this one with them: a parked wheel creeps and slips by tenths of a millimetre."""
        self._velocities.append(self.base.velocity())
        return Twist2D(*np.mean([(v.vx, v.vy, v.wz) for v in self._velocities], axis=0).tolist())


class TwinJoints:
    """Takes ``JointTrajectory`` of one point with positions: goes there in a straight line in ``time_from_start``."""

    def __init__(self, world: TwinWorld, group: JointGroup, ros_names: tuple[str, ...]) -> None:
        self._world, self.group, self.ros_names = world, group, ros_names
        self._lower = group.model.lower
        self._upper = group.model.upper
        self._speed = group.model.velocity
        self._wanted: Array | None = None
        self._goal: Array = np.zeros(len(self._lower))
        self._left = 0.0
        self._resting = True

    def follow(self, message: Mapping[str, Any]) -> None:
        """A trajectory has come; from any thread."""
        order = [message["joint_names"].index(name) for name in self.ros_names]
        point = message["points"][-1]
        positions = np.array([float(point["positions"][index]) for index in order])
        duration = point["time_from_start"]
        seconds = sum(float(v) * (1e-9 if n in ("nsecs", "nanosec") else 1.0) for n, v in duration.items())
        if not np.all(np.isfinite(positions)):
            raise ValueError(f"positions should be finite but are {positions.tolist()}")
        goal = np.clip(positions, self._lower, self._upper)
        self._world.post(lambda: self._take(goal, seconds))

    def tick(self, dt: float) -> None:
        """One physics step of the world is about to come."""
        if self._resting or self._wanted is None:
            return
        step = min(1.0, dt / max(self._left, dt))
        velocity = (self._goal - self._wanted) * step / dt
        self._wanted = self._wanted + velocity * dt
        self._left = max(0.0, self._left - dt)
        error = self._wanted - self.group.positions()
        if self._left == 0.0 and np.max(np.abs(error)) < AT_GOAL:
            self._resting = True
            self.group.command(positions=self._goal)
        else:
            self.group.command(velocities=np.clip(velocity + TRACKING_GAIN * error, -self._speed, self._speed))

    def _take(self, goal: Array, seconds: float) -> None:
        if self._resting:
            self._wanted = self.group.positions()
        self._goal, self._left, self._resting = goal, seconds, False
