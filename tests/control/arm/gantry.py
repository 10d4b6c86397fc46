"""An arm whose seven joints are the tool's place, its turn as a rotation vector, and one that moves nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.control.arm.arm_controller import ArmController
from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics
from bestman_bt.messages import Pose, Wrench
from hal.parts.simulated_clock import SimulatedClock
from tests.control.scripted_parts import ScriptedArm, stepped_clock

Array = NDArray[np.float64]


class Gantry(InverseKinematics):
    """``reachable``: whether the tool can be at a place (3,). ``measure``: the manipulability there."""

    def __init__(self) -> None:
        self.reachable: Callable[[Array], bool] = lambda place: True
        self.measure: Callable[[Array], float] = lambda place: 0.1

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(f"joint_{number}" for number in range(1, 8))

    @property
    def reach(self) -> tuple[Array, float]:
        return np.zeros(3), 10.0

    def tool_pose(self, positions: ArrayLike) -> Pose:
        values = np.asarray(positions, float)
        return Pose(values[:3], Rotation.from_rotvec(values[3:6]).as_quat())

    def solve(self, base_from_tool, reference, rng, count=1, is_valid=None, attempts=None) -> IKResult:
        raise NotImplementedError  # no test calls it

    def track(self, base_from_tool: Pose, start: ArrayLike) -> Array | None:
        if not self.reachable(base_from_tool.position):
            return None
        turn = Rotation.from_quat(base_from_tool.quaternion).as_rotvec()
        return np.concatenate([base_from_tool.position, turn, np.asarray(start, float)[6:]])

    def tool_direction(self, positions: Array, axis: Array) -> Array:
        return np.asarray(self.tool_pose(positions).rotation @ axis)

    def jacobian(self, positions: ArrayLike) -> Array:
        return np.eye(6, 7)

    def manipulability(self, positions: ArrayLike) -> float:
        return self.measure(np.asarray(positions, float)[:3])


class Felt:
    """A wrist that feels what ``force`` (3,), base frame, says of the tool's pose. ``error``: raised instead."""

    def __init__(self, force: Callable[[Pose], Array]) -> None:
        self.force = force
        self.error: Exception | None = None

    def contact_at(self, base_from_tool: Pose) -> Wrench:
        if self.error is not None:
            raise self.error
        return Wrench(self.force(base_from_tool), np.zeros(3), 0.0)


START = np.array([0.4, -0.2, 0.9, 0.0, 0.0, 0.5, 0.3])


class AtWork:
    """An arm controller on a gantry: ``force`` is what the tool feels."""

    def __init__(
        self,
        force: Callable[[Pose], Array] = lambda pose: np.zeros(3),
        velocity: float = 2.0,
        acceleration: float = 100.0,
        **kwargs,
    ) -> None:
        self.arm = ScriptedArm(START, velocity, acceleration=acceleration)
        self.kinematics, self.wrist = Gantry(), Felt(force)
        self.clock: SimulatedClock = stepped_clock(time_step=1.0 / 60.0)
        self.controller = ArmController(self.arm, self.clock, kinematics=self.kinematics, wrist=self.wrist, **kwargs)

    @property
    def tool(self) -> Pose:
        return self.kinematics.tool_pose(self.arm.at)

    def wait(self, handle, limit: float = 30.0):
        end = self.clock.now() + limit
        while not handle.done and self.clock.now() < end:
            self.clock.sleep(1.0 / 60.0)
        return handle


def spring(place: Array, normal: Array, stiffness: float) -> Callable[[Pose], Array]:
    """A wall at ``place`` that pushes a tool back along ``normal`` which is behind it."""
    unit = normal / np.linalg.norm(normal)

    def force(pose: Pose) -> Array:
        depth = float((place - pose.position) @ unit)
        return stiffness * max(0.0, depth) * unit

    return force
