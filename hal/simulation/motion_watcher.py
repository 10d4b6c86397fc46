"""Detects motion that no velocity explains, regardless of its cause, and joints beyond their limits."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import GRAVITY
from bestman_bt.robot_model.model import ArmModel, GripperModel, JointGroupModel, LeggedBaseModel
from hal.simulation.audit_record import Finding
from hal.simulation.bodies import BodyState
from hal.simulation.guards import Reader
from hal.simulation.observation import SimulationState
from hal.simulation.simulation import Simulation

# Metres, radians, seconds. A body is integrated in every step while it is awake; one that rests has WAKING to begin to
# fall or roll within one look, and HIT if something else may have hit it.
AWAKE_SPEED = 2e-3
AWAKE_TIME = 0.25
WAKING = 5e-4
HIT = 1e-3
POSITION_JUMP = 1e-4
DRIFT = 5e-4
DRIFT_DECAY = 0.98
ROTATION_JUMP = 0.01
JOINT_JUMP = 0.01
STUTTER = 1.5
FREE_FALL_TOLERANCE = 0.1
RESTS_ON_NOTHING = 30  # looks in a row
LIMIT_TOLERANCE = 5e-3
SPEED_TOLERANCE = (1.05, 0.02)


class MotionWatcher:
    """Compares how far bodies and joints have moved with the motion explained by their velocities.

    In every step a body moves by exactly its velocity after the step; ``integrate`` sums this between two observations.
    A reset of a pose or of a state causes a residual, and small ones accumulate. Joints are compared with the mean of
    their velocities before and after.
    """

    def __init__(self, simulation: Simulation, reader: Reader) -> None:
        built, model = simulation.built, simulation.model
        self._velocity, self._time_step = reader.body_velocity, simulation.parameters.time_step
        self._objects = {body: name for name, body in built.objects.items()}
        self._robot, self._robot_touches = built.robot, False
        self._names = {**self._objects, built.robot: "robot"}
        self._joint_names = simulation.joint_names
        lower, upper, speed = (np.full(len(self._joint_names), value) for value in (-np.inf, np.inf, np.inf))
        groups: list[ArmModel | JointGroupModel] = [*model.of(ArmModel).values(), *model.of(JointGroupModel).values()]
        for group in groups:
            slots = simulation.slots(group.joint_names)
            lower[slots], upper[slots], speed[slots] = group.lower, group.upper, group.velocity
        for walker in (base.part for base in model.of(LeggedBaseModel).values()):
            slots, limits = simulation.slots(walker.joints), walker.limits
            lower[slots], upper[slots], speed[slots] = limits.lower, limits.upper, limits.velocity
        for gripper in model.of(GripperModel).values():
            slots = simulation.slots(gripper.part.joints)
            lower[slots], upper[slots] = gripper.joint_range
            speed[slots] = gripper.part.max_speed * gripper.fastest_transmission
        fastest = speed * SPEED_TOLERANCE[0] + SPEED_TOLERANCE[1]
        self._least = np.array((lower - LIMIT_TOLERANCE, -fastest))
        self._most = np.array((upper + LIMIT_TOLERANCE, fastest))
        self._beyond: NDArray[np.bool_] = np.zeros(self._most.shape, bool)
        # Infinite for the wheels, which have no limits: they slip and stutter, and no pose hangs on them.
        period = simulation.parameters.monitor_every * self._time_step
        self._stutter = JOINT_JUMP + STUTTER * period * speed
        self._before: SimulationState | None = None
        self._drift: dict[int, list[float]] = {body: [0.0] * 3 for body in self._names}
        self.awake: list[int] = list(self._names)
        self._awake_until = dict.fromkeys(self._names, 0.0)
        self._paths: dict[int, list[float]] = {}
        self._afloat: dict[int, int] = dict.fromkeys(self._objects, 0)
        self._touched_before: set[int] = set(self._objects)
        self.jumps: list[Finding] = []
        self.unexplained_forces: list[Finding] = []
        self.joint_limits: list[Finding] = []
        self.velocity_limits: list[Finding] = []

    def watch(
        self,
        observation: SimulationState,
        touched: set[int],
        robot_forces: Mapping[int, float],
        put_down: Collection[int] = (),
    ) -> None:
        """Process one observation.

        ``touched``: the bodies that have contacts now, except wheels on the floor, and moving objects that had some
        since the observation before. ``robot_forces``: the robot's normal force on each body that it touches, newtons.
        ``put_down``: objects placed by a script.
        """
        self._robot_touches = self._robot in touched or self._robot in self._touched_before
        before = self._begin_anew(put_down, observation)
        if before is not None:
            time = observation.stamp - before.stamp
            undisturbed = not self._robot_touches and not any(body in self._objects for body in self.awake)
            for body, new in observation.bodies.items():
                old = before.bodies[body]
                if body in self._paths or new != old:  # else it rests as it did
                    self._watch_body(body, old, new, time, undisturbed, observation.stamp)
            for body in self._objects:
                if body in self._paths:
                    self._watch_free_fall(body, before.bodies[body], observation, time, touched)
                else:
                    self._watch_rest(body, observation.stamp, touched)
            self._watch_joints(before, observation, time)
        self.watch_limits(observation)
        self._before, self._touched_before = observation, touched
        self._wake(observation, robot_forces)

    def integrate(self) -> None:
        """Add the motion of one physics step, by which the poses have just moved, from the velocities after it."""
        velocity, step = self._velocity, self._time_step
        for body, path in self._paths.items():
            (x, y, z), (a, b, c) = velocity(body)
            path[0] += x * step
            path[1] += y * step
            path[2] += z * step
            path[3] += (a * a + b * b + c * c) ** 0.5 * step

    def _begin_anew(self, put_down: Collection[int], observation: SimulationState) -> SimulationState | None:
        """Return the look before, as if what was put down since then had always been where it is."""
        if self._before is None:
            return None
        for body in put_down:
            self._paths.pop(body, None)
            self._drift[body][:] = (0.0, 0.0, 0.0)
            self._afloat[body] = 0
            self._awake_until[body] = observation.stamp + AWAKE_TIME
        there = {body: observation.bodies[body] for body in put_down}
        return self._before._replace(bodies={**self._before.bodies, **there})

    def _wake(self, observation: SimulationState, robot_forces: Mapping[int, float]) -> None:
        """Wake bodies that moved or that the robot touched recently: they are integrated in every step until the next
        check.
        """
        for body, state in observation.bodies.items():
            speed = math.hypot(*state.linear) + 0.1 * math.hypot(*state.angular)
            if body == self._robot or body in robot_forces or speed > AWAKE_SPEED:
                self._awake_until[body] = observation.stamp + AWAKE_TIME
        self.awake = [body for body, end in self._awake_until.items() if end > observation.stamp]
        self._paths = {body: [0.0, 0.0, 0.0, 0.0] for body in self.awake}

    def _watch_body(
        self, body: int, old: BodyState, new: BodyState, time: float, undisturbed: bool, stamp: float
    ) -> None:
        """Check that an integrated body moved along its path, and that a resting one did not, unless it may have been
        hit.
        """
        path = self._paths.get(body)
        slack = 0.0
        if path is None:
            path = [0.5 * time * (u + v) for u, v in zip(old.linear, new.linear, strict=True)]
            path.append(time * (math.hypot(*old.angular) + math.hypot(*new.angular)))
            slack = WAKING if undisturbed else HIT + time * math.hypot(*new.linear)
        drift = self._drift[body]
        (x, y, z), (x0, y0, z0) = new.position, old.position
        rx, ry, rz = x - x0 - path[0], y - y0 - path[1], z - z0 - path[2]
        if math.hypot(rx, ry, rz) > POSITION_JUMP + slack:
            distance = 1e3 * math.dist(old.position, new.position)
            self.jumps.append(Finding(stamp, f"{self._names[body]} jumped by {distance:.1f} mm"))
            drift[:] = (0.0, 0.0, 0.0)
            return
        if slack <= WAKING:
            # Bullet leaves some bodies at rest a velocity that moves nothing: what has not moved has not crept.
            residual = math.hypot(rx, ry, rz)
            share = min(1.0, math.dist(new.position, old.position) / residual) if residual > 0.0 else 0.0
            drift[0] = DRIFT_DECAY * drift[0] + share * rx
            drift[1] = DRIFT_DECAY * drift[1] + share * ry
            drift[2] = DRIFT_DECAY * drift[2] + share * rz
            if math.hypot(*drift) > DRIFT:
                self.jumps.append(Finding(stamp, f"{self._names[body]} crept by {1e3 * math.hypot(*drift):.1f} mm"))
                drift[:] = (0.0, 0.0, 0.0)
        (a, b, c, d), (a0, b0, c0, d0) = new.quaternion, old.quaternion
        turned = 2.0 * math.acos(min(1.0, abs(a * a0 + b * b0 + c * c0 + d * d0)))
        if turned > ROTATION_JUMP + path[3] + 20.0 * slack:
            text = f"{self._names[body]} turned by {math.degrees(turned):.1f} degrees at once"
            self.jumps.append(Finding(stamp, text))

    def _watch_free_fall(
        self, body: int, old: BodyState, observation: SimulationState, time: float, touched: set[int]
    ) -> None:
        """Check that bodies without contact fall with g."""
        if body in touched or body in self._touched_before:
            self._afloat[body] = 0
            return
        new = observation.bodies[body].linear
        expected = (old.linear[0], old.linear[1], old.linear[2] - GRAVITY * time)
        self._afloat[body] = self._afloat[body] + 1 if math.dist(new, expected) > FREE_FALL_TOLERANCE else 0
        if self._afloat[body] == 3:
            text = f"{self._objects[body]} touches nothing and does not fall freely"
            self.unexplained_forces.append(Finding(observation.stamp, text))

    def _watch_rest(self, body: int, stamp: float, touched: set[int]) -> None:
        """Check that bodies at rest have support."""
        self._afloat[body] = 0 if body in touched else self._afloat[body] + 1
        if self._afloat[body] == RESTS_ON_NOTHING:
            self.unexplained_forces.append(Finding(stamp, f"{self._objects[body]} rests on nothing and does not fall"))

    def _watch_joints(self, before: SimulationState, observation: SimulationState, time: float) -> None:
        """Check that joints were no faster than their top speed between two checks, with a margin for motors and
        impacts.
        """
        old, new = before.joints, observation.joints
        change = new[:2] - old[:2]
        residual = np.abs(change[0] - (old[1] + new[1]) * (time / 2.0))
        jumped = residual > self._stutter + np.abs(change[1]) * time
        if jumped.any():
            for slot in np.flatnonzero(jumped):
                text = f"{self._joint_names[slot]} jumped by {change[0, slot]:.4f}"
                self.jumps.append(Finding(observation.stamp, text))

    def watch_limits(self, observation: SimulationState) -> None:
        """Record joints that have exceeded a limit since the last call."""
        states = observation.joints[:2]
        beyond = (states < self._least) | (states > self._most)
        if beyond.any():
            for row, slot in np.argwhere(beyond & ~self._beyond):
                findings, unit = ((self.joint_limits, ""), (self.velocity_limits, " per second"))[row]
                text = f"{self._joint_names[slot]} at {states[row, slot]:.4f}{unit}"
                findings.append(Finding(observation.stamp, text))
        self._beyond = beyond
