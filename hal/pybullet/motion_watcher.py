"""Watches for motion that no velocity explains, whoever caused it, and for joints beyond their limits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import ArmModel, JointGroupModel
from hal.pybullet.client import Reader
from hal.pybullet.honesty_record import Finding
from hal.pybullet.observation import BodyState, Observation
from hal.pybullet.simulation import Simulation

POSITION_JUMP = 1e-4
DRIFT = 5e-4
ROTATION_JUMP = 0.01
JOINT_JUMP = 0.01
STUTTER = 1.5
GRAVITY = 9.81
FREE_FALL_TOLERANCE = 0.1
LIMIT_TOLERANCE = 5e-3
SPEED_TOLERANCE = (1.05, 0.02)


class MotionWatcher:
    """Compares how far bodies and joints have moved with what their velocities before and after explain.

    In every step a body moves by exactly its velocity after the step: ``integrate`` sums that up between two looks. A
    reset of a pose or of a state shows as a residual, and a row of small ones adds up. Joints are held to the mean of
    their velocities before and after.
    """

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built, model = simulation.built, simulation.model
        self._velocity, self._time_step = reader.getBaseVelocity, simulation.parameters.time_step
        self._objects = {body: name for name, body in built.objects.items()}
        self._robot, self._robot_touches = built.robot, False
        self._names = {**self._objects, built.robot: "robot"}
        self._joint_names = simulation.joint_names
        lower, upper, speed = (np.full(len(self._joint_names), value) for value in (-np.inf, np.inf, np.inf))
        groups: list[ArmModel | JointGroupModel] = [*model.arms.values(), *model.joint_groups.values()]
        for group in groups:
            slots = simulation.slots(group.joint_names)
            lower[slots], upper[slots], speed[slots] = group.lower, group.upper, group.velocity
        for gripper in model.grippers.values():
            slots, count = simulation.slots(gripper.joint_names), len(gripper.joint_names)
            lower[slots], upper[slots] = gripper.min_width / count, gripper.max_width / count
            speed[slots] = gripper.max_speed / count
        self._lower, self._upper = lower - LIMIT_TOLERANCE, upper + LIMIT_TOLERANCE
        self._watched = np.isfinite(speed)  # not the wheels: they slip and stutter, and no pose hangs on them
        self._top_speed = np.where(self._watched, speed, 0.0)
        self._speed = speed * SPEED_TOLERANCE[0] + SPEED_TOLERANCE[1]
        self._beyond: NDArray[np.bool_] = np.zeros(len(self._joint_names), bool)
        self._too_fast = self._beyond.copy()
        self._before: Observation | None = None
        self._drift: dict[int, NDArray[np.float64]] = {body: np.zeros(3) for body in self._names}
        self._paths: dict[int, list[float]] = {body: [0.0] * 4 for body in self._names}
        self._afloat: dict[int, int] = dict.fromkeys(self._objects, 0)
        self._touched_before: set[int] = set(self._objects)
        self.jumps: list[Finding] = []
        self.unexplained_forces: list[Finding] = []
        self.joint_limits: list[Finding] = []
        self.velocity_limits: list[Finding] = []

    def watch(self, observation: Observation, touched: set[int]) -> None:
        """Take in one observation; ``touched``: the bodies that have contacts now, but for wheels on the floor."""
        self._robot_touches = self._robot in touched or self._robot in self._touched_before
        before = self._before
        if before is None:
            for path in self._paths.values():
                path[:] = [0.0] * 4
        else:
            time = observation.stamp - before.stamp
            for body in self._names:
                self._watch_body(body, before.bodies[body], observation.bodies[body], observation.stamp)
            for body in self._objects:
                self._watch_free_fall(body, before.bodies[body], observation, time, touched)
            self._watch_joints(before, observation, time)
        self._watch_limits(observation)
        self._before, self._touched_before = observation, touched

    def integrate(self) -> None:
        """Take in the velocities after one physics step; the pose has just moved by them."""
        velocity, step = self._velocity, self._time_step
        for body, path in self._paths.items():
            (x, y, z), angular = velocity(body)
            path[0] += x * step
            path[1] += y * step
            path[2] += z * step
            path[3] += math.hypot(*angular) * step

    def _watch_body(self, body: int, old: BodyState, new: BodyState, stamp: float) -> None:
        name, path = self._names[body], self._paths[body]
        residual = [new.position[k] - old.position[k] - path[k] for k in range(3)]
        turn, path[:] = path[3], [0.0] * 4
        if math.hypot(*residual) > POSITION_JUMP:
            distance = 1e3 * math.dist(old.position, new.position)
            self.jumps.append(Finding(stamp, f"{name} jumped by {distance:.1f} mm"))
            self._drift[body][:] = 0.0
            return
        drift = self._drift[body]
        drift += residual
        if drift @ drift > DRIFT**2:
            self.jumps.append(Finding(stamp, f"{name} crept by {1e3 * float(np.linalg.norm(drift)):.1f} mm"))
            drift[:] = 0.0
        cosine = abs(sum(a * b for a, b in zip(old.quaternion, new.quaternion, strict=True)))
        turned = 2.0 * math.acos(min(1.0, cosine))
        if turned > ROTATION_JUMP + turn:
            self.jumps.append(Finding(stamp, f"{name} turned by {math.degrees(turned):.1f} degrees at once"))

    def _watch_free_fall(
        self, body: int, old: BodyState, observation: Observation, time: float, touched: set[int]
    ) -> None:
        """What touches nothing falls with g."""
        if body in touched or body in self._touched_before:
            self._afloat[body] = 0
            return
        new = observation.bodies[body].linear
        expected = (old.linear[0], old.linear[1], old.linear[2] - GRAVITY * time)
        self._afloat[body] = self._afloat[body] + 1 if math.dist(new, expected) > FREE_FALL_TOLERANCE else 0
        if self._afloat[body] == 3:
            text = f"{self._objects[body]} touches nothing and does not fall freely"
            self.unexplained_forces.append(Finding(observation.stamp, text))

    def _watch_joints(self, before: Observation, observation: Observation, time: float) -> None:
        """Free joints move smoothly; those of a robot that bumps into something stutter, up to their top speed."""
        old, new = before.joints, observation.joints
        residual = np.abs(new[0] - old[0] - (old[1] + new[1]) * (time / 2.0))
        slack = JOINT_JUMP + (STUTTER * time * self._top_speed if self._robot_touches else 0.0)
        jumped = self._watched & (residual > slack + np.abs(new[1] - old[1]) * time)
        for slot in np.flatnonzero(jumped):
            moved = new[0, slot] - old[0, slot]
            self.jumps.append(Finding(observation.stamp, f"{self._joint_names[slot]} jumped by {moved:.4f}"))

    def _watch_limits(self, observation: Observation) -> None:
        position, velocity = observation.joints[0], np.abs(observation.joints[1])
        beyond = (position < self._lower) | (position > self._upper)
        too_fast = velocity > self._speed
        for slot in np.flatnonzero(beyond & ~self._beyond):
            text = f"{self._joint_names[slot]} at {position[slot]:.4f}"
            self.joint_limits.append(Finding(observation.stamp, text))
        for slot in np.flatnonzero(too_fast & ~self._too_fast):
            text = f"{self._joint_names[slot]} at {velocity[slot]:.3f} per second"
            self.velocity_limits.append(Finding(observation.stamp, text))
        self._beyond, self._too_fast = beyond, too_fast
