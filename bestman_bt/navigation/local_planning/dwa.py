"""The dynamic window approach (Fox, Burgard and Thrun 1997) with critics, as nav2's DWB controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from bestman_bt.messages.shapes import Count, NonNegative, NotBelow, Positive
from bestman_bt.navigation.local_planning.critics import Critics, Drives, Surroundings
from bestman_bt.navigation.local_planning.obstacle_aware import ObstacleAwareFollower
from bestman_bt.robot_model.part_config import MobilePart

Floats = NDArray[np.float32]


@dataclass(eq=False)
class DWA(ObstacleAwareFollower):
    """Samples the reachable velocities, each held over the horizon; deterministic.

    ``forward_samples``, ``sideways_samples`` (for omnidirectional bases), ``turn_samples``: numbers of velocities.
    ``window``: seconds within which a velocity must be reachable. ``horizon``, ``step``: seconds, of the drives at
    constant velocity. ``reverse``: largest speed backwards, m/s. ``oscillation_distance`` (m), ``oscillation_angle``
    (rad): motion before a velocity may change its sign a second time, or ``oscillation_time`` (s).
    """

    forward_samples: Count = 11
    sideways_samples: Count = 5
    turn_samples: Count = 15
    window: Annotated[Positive, "s"] = 0.3
    horizon: Annotated[Positive, NotBelow("step"), "s"] = 1.6
    step: Annotated[Positive, "s"] = 0.1
    reverse: Annotated[NonNegative, "m/s"] = 0.15
    oscillation_distance: Annotated[NonNegative, "m"] = 0.05
    oscillation_angle: Annotated[NonNegative, "rad"] = 0.2
    oscillation_time: Annotated[NonNegative, "s"] = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._oscillation: _Oscillation | None = None

    @override
    def begin(self, limits: MobilePart, critics: Critics) -> None:
        self._base, self._critics = limits, critics

    @override
    def restart(self) -> None:
        self._oscillation = None

    @override
    def choose(self, pose: Pose2D, twist: Twist2D, around: Surroundings, dt: float) -> Twist2D:
        base = self._base
        if self._oscillation is None:
            self._oscillation = _Oscillation(self.oscillation_distance, self.oscillation_angle, self.oscillation_time)
        vx, vy, wz = self._window(twist)
        allowed = self._oscillation.allowed(vx, vy, wz, pose, dt)
        vx, vy, wz = vx[allowed], vy[allowed], wz[allowed]
        drives = _simulated(pose, vx, vy, wz, round(self.horizon / self.step), self.step)
        costs, contact = self._critics.judge(drives, around)
        # Fox's admissible velocities: those from which the base can stop before it touches anything.
        braking = np.maximum(np.hypot(vx, vy) / base.max_acceleration, np.abs(wz) / base.max_angular_acceleration)
        admissible = contact * self.step > self.reaction + braking / 2.0
        if not admissible.any():
            return Twist2D()
        best = int(np.argmin(np.where(admissible, costs, np.inf)))
        chosen = Twist2D(float(vx[best]), float(vy[best]), float(wz[best]))
        self._oscillation.note(chosen, pose)
        return chosen

    def _window(self, twist: Twist2D) -> tuple[Floats, Floats, Floats]:
        """Return velocities that can be reached within the window, (B,) each; standing still and going straight among
        them.
        """
        base = self._base
        change, turn = base.max_acceleration * self.window, base.max_angular_acceleration * self.window
        forward = _samples(twist.vx, change, -self.reverse, base.max_vx, self.forward_samples)
        turning = _samples(twist.wz, turn, -base.max_wz, base.max_wz, self.turn_samples)
        count = self.sideways_samples if base.max_vy else 1
        sideways = _samples(twist.vy, change, -base.max_vy, base.max_vy, count)
        vx, vy, wz = (grid.ravel().astype(np.float32) for grid in np.meshgrid(forward, sideways, turning))
        possible = np.hypot(vx, vy) <= base.max_vx + 1e-6
        return vx[possible], vy[possible], wz[possible]


class _Oscillation:
    """nav2's oscillation critic: a velocity that has changed its sign keeps the new one until the base got on."""

    def __init__(self, distance: float, angle: float, time: float) -> None:
        self._distance, self._angle, self._time = distance, angle, time
        self._signs = [0, 0, 0]
        self._kept: list[Pose2D | None] = [None, None, None]
        self._kept_for = [0.0, 0.0, 0.0]

    def allowed(self, vx: Floats, vy: Floats, wz: Floats, pose: Pose2D, dt: float) -> NDArray[np.bool_]:
        allowed = np.ones(len(vx), dtype=bool)
        for axis, values in enumerate((vx, vy, wz)):
            since = self._kept[axis]
            if since is None:
                continue
            self._kept_for[axis] += dt
            turned = abs(wrap_angle(pose.theta - since.theta))
            if pose.distance_to(since) > self._distance or turned > self._angle or self._kept_for[axis] > self._time:
                self._kept[axis] = None
            else:
                allowed &= values * self._signs[axis] >= 0.0
        return allowed

    def note(self, chosen: Twist2D, pose: Pose2D) -> None:
        for axis, (value, still) in enumerate(((chosen.vx, 0.02), (chosen.vy, 0.02), (chosen.wz, 0.05))):
            sign = 0 if abs(value) < still else (1 if value > 0.0 else -1)
            if sign and self._signs[axis] and sign != self._signs[axis]:
                self._kept[axis], self._kept_for[axis] = pose, 0.0
            self._signs[axis] = sign or self._signs[axis]


def _samples(now: float, change: float, lowest: float, highest: float, count: int) -> NDArray[np.float64]:
    """Return ``count`` velocities around ``now``; one of them is zero if zero can be reached."""
    if count == 1:
        return np.zeros(1)
    values = np.linspace(max(lowest, min(now - change, highest)), min(highest, max(now + change, lowest)), count)
    if values[0] < 0.0 < values[-1]:
        values[np.argmin(np.abs(values))] = 0.0
    return values


def _simulated(pose: Pose2D, vx: Floats, vy: Floats, wz: Floats, steps: int, step: float) -> Drives:
    """Return the poses of drives at constant velocities (B,): arcs by the midpoint rule, exact to a millimetre."""
    times = (np.arange(steps, dtype=np.float32) + np.float32(1.0)) * np.float32(step)
    theta = np.float32(pose.theta) + wz[:, None] * times
    middle = theta - wz[:, None] * np.float32(step / 2)
    cos, sin = np.cos(middle), np.sin(middle)
    forward, sideways = vx[:, None], vy[:, None]
    x = np.float32(pose.x) + np.cumsum(forward * cos - sideways * sin, axis=1) * np.float32(step)
    y = np.float32(pose.y) + np.cumsum(forward * sin + sideways * cos, axis=1) * np.float32(step)
    return Drives(x, y, theta, (forward, sideways, wz[:, None]), step)
