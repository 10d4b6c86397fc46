"""Model predictive path integral control (Williams et al. 2017) with critics, as nav2's MPPI controller."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, NonNegativeInt, NotBelow, Positive, Several
from bestman_bt.navigation.local_planning.critics import Critics, Drives, Surroundings
from bestman_bt.navigation.local_planning.obstacle_aware import ObstacleAwareFollower
from bestman_bt.robot_model.part_config import MobilePart

Floats = NDArray[np.float32]


@dataclass(eq=False)
class MPPI(ObstacleAwareFollower):
    """Perturbs the last best drive randomly, and continues with the cost-weighted mean.

    Deterministic: the generator of the samples is reset for each path. ``batch``: drives of ``steps`` steps of ``step``
    seconds, sampled ``iterations`` times per command. ``forward_std``, ``sideways_std`` (m/s), ``turn_std`` (rad/s): of
    the perturbation, at ``knots`` times with linear interpolation, so that drives are smooth; half of the drives get
    only ``fine`` of it, for narrow places. ``temperature``: of the mean; low: the best few decide. ``reverse``: largest
    speed backwards, m/s. ``seed``: of the samples.
    """

    batch: Several = 320
    steps: Annotated[Count, NotBelow("knots")] = 20
    step: Annotated[Positive, "s"] = 0.1
    iterations: Count = 1
    knots: Several = 6
    forward_std: Annotated[NonNegative, "m/s"] = 0.2
    sideways_std: Annotated[NonNegative, "m/s"] = 0.2
    turn_std: Annotated[NonNegative, "rad/s"] = 0.5
    fine: Fraction = 0.3
    temperature: Positive = 0.08
    reverse: Annotated[NonNegative, "m/s"] = 0.15
    seed: NonNegativeInt = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        at, knots = np.linspace(0.0, self.knots - 1.0, self.steps), np.arange(self.knots)
        self._spread = np.maximum(0.0, 1.0 - np.abs(at[None, :] - knots[:, None])).astype(np.float32)
        self.restart()

    @override
    def begin(self, limits: MobilePart, critics: Critics) -> None:
        self._base, self._critics = limits, critics
        self._axes = (0, 1, 2) if limits.max_vy else (0, 2)
        self._std = np.array([self.forward_std, self.sideways_std, self.turn_std], dtype=np.float32)
        self._low = np.array([-self.reverse, -limits.max_vy, -limits.max_wz], dtype=np.float32)
        self._high = np.array([limits.max_vx, limits.max_vy, limits.max_wz], dtype=np.float32)
        change = np.array([limits.max_acceleration, limits.max_acceleration, limits.max_angular_acceleration])
        self._change = (change * self.step).astype(np.float32)

    @override
    def restart(self) -> None:
        self._rng = np.random.default_rng(self.seed)
        self._plan = np.zeros((3, self.steps), dtype=np.float32)

    @override
    def choose(self, pose: Pose2D, twist: Twist2D, around: Surroundings, dt: float) -> Twist2D:
        now = np.array([twist.vx, twist.vy, twist.wz], dtype=np.float32)
        for _ in range(self.iterations):
            controls = self._sampled(now)
            drives = self._simulated(pose, controls)
            costs, contact = self._critics.judge(drives, around)
            weights = np.exp((costs.min() - costs) / np.float32(self.temperature))
            self._plan = np.einsum("b,abt->at", weights / weights.sum(), controls)
        if contact[int(np.argmin(costs))] < self.steps // 2:
            self._plan[:] = 0.0
            return Twist2D()
        # The velocity that the plan has when the command has taken effect; then the plan moves on by dt.
        chosen = self._plan[:, 0].astype(float)
        share = np.float32(dt / self.step)
        self._plan[:, :-1] += share * (self._plan[:, 1:] - self._plan[:, :-1])
        return Twist2D(*chosen.tolist())

    def _sampled(self, now: NDArray[np.float32]) -> Floats:
        """Return velocities (3, B, T) within the limits of speed and acceleration; the last plan and braking among
        them.
        """
        controls = np.repeat(self._plan[:, None, :], self.batch, axis=1)
        for axis in self._axes:
            samples = self._rng.standard_normal((self.batch - 2, self.knots + 1), dtype=np.float32)
            # What is kept up through the drive and what changes: alone, changes would cancel out and lead nowhere.
            knots = np.float32(math.sqrt(0.5)) * (samples[:, :-1] + samples[:, -1:])
            knots[::2] *= np.float32(self.fine)
            controls[axis, 2:] += self._std[axis] * (knots @ self._spread)
        controls[:, 1] = 0.0
        np.clip(controls, self._low[:, None, None], self._high[:, None, None], out=controls)
        by_step = np.ascontiguousarray(controls.transpose(2, 0, 1))
        before: Floats = np.repeat(now[:, None], self.batch, axis=1)
        change = self._change[:, None]
        for step in by_step:
            np.clip(step, before - change, before + change, out=step)
            before = step
        return by_step.transpose(1, 2, 0)

    def _simulated(self, pose: Pose2D, controls: Floats) -> Drives:
        dt = np.float32(self.step)
        vx, vy, wz = controls
        theta = np.cumsum(wz, axis=1)
        theta *= dt
        theta += np.float32(pose.theta)
        middle = theta - np.float32(0.5) * dt * wz
        cos, sin = np.cos(middle), np.sin(middle)
        if self._base.max_vy:
            dx, dy = vx * cos - vy * sin, vx * sin + vy * cos
        else:
            dx, dy = vx * cos, vx * sin
        x = np.float32(pose.x) + np.cumsum(dx, axis=1) * dt
        y = np.float32(pose.y) + np.cumsum(dy, axis=1) * dt
        return Drives(x, y, theta, (vx, vy, wz), self.step)
