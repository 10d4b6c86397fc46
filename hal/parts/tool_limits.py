"""Where an arm's tool is and how fast it moves, held to the workspace and the speed of the robot's ``safety``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import ArmModel, RobotModel
from bestman_bt.robot_model.connection_config import SafetyConfig

if TYPE_CHECKING:
    import pinocchio

Array = NDArray[np.float64]


class ToolLimits:
    """Checks joint positions (n,) of one arm. The pose of other joints between base and arm is taken as ``home``.

    ``top_speed``: m/s; None where nothing is said. Kinematics by pinocchio on the robot's URDF; both
    are loaded when first needed.
    """

    def __init__(self, model: RobotModel, arm: str, safety: SafetyConfig) -> None:
        self._robot, self._arm, self._safety = model, model.of(ArmModel)[arm], safety
        self.top_speed = safety.tool_speed
        self._model: pinocchio.Model | None = None

    @property
    def needed(self) -> bool:
        """Whether there is anything to hold the tool to."""
        return self._safety.workspace is not None or self._safety.tool_speed is not None

    def outside(self, positions: Array) -> str | None:
        """Where the tool would leave the workspace, in words, else None."""
        box = self._safety.workspace
        if box is None:
            return None
        tool = self.tool(positions)
        for axis, value, lower, upper in zip("xyz", tool, box.lower, box.upper, strict=True):
            if not lower <= value <= upper:
                return f"the tool would be at {axis} = {value:.3f} m, its workspace is [{lower:.3f}, {upper:.3f}] m"
        return None

    def outside_on_the_way(self, start: Array, end: Array) -> str | None:
        """As ``outside``, on the straight line in joint space; sampled every 0.05 rad."""
        if self._safety.workspace is None:
            return None
        count = 1 + int(np.ceil(np.max(np.abs(end - start)) / 0.05))
        faults = (self.outside(start + share * (end - start)) for share in np.linspace(1.0, 0.0, count, endpoint=False))
        return next((fault for fault in faults if fault is not None), None)

    def slow_down(self, positions: Array, velocities: Array) -> float:
        """The share, within (0, 1], of its speed at which a motion through these samples, (N, n) each, may run."""
        limit = self._safety.tool_speed
        if limit is None:
            return 1.0
        fastest = max(self.tool_speed(q, v) for q, v in zip(positions, velocities, strict=True))
        return min(1.0, limit / max(fastest, 1e-9))

    def tool(self, positions: Array) -> Array:
        """The tool in the robot's base frame, (3,) metres."""
        import pinocchio

        model, data, q = self._at(positions)
        pinocchio.framesForwardKinematics(model, data, q)
        base, tool = data.oMf[self._base], data.oMf[self._tool]
        place: Array = np.asarray(base.actInv(tool).translation).copy()
        return place

    def tool_speed(self, positions: Array, velocities: Array) -> float:
        """Speed of the tool relative to the base, m/s, when only this arm moves."""
        import pinocchio

        model, data, q = self._at(positions)
        jacobian = pinocchio.computeFrameJacobian(model, data, q, self._tool, pinocchio.LOCAL_WORLD_ALIGNED)
        return float(np.linalg.norm(jacobian[:3, self._columns] @ velocities))

    def _at(self, positions: Array) -> tuple[pinocchio.Model, pinocchio.Data, Array]:
        if self._model is None:
            self._load()
        q = self._neutral.copy()
        q[self._slots] = positions
        return self._model, self._data, q

    def _load(self) -> None:
        import pinocchio

        model = pinocchio.buildModelFromXML(self._robot.urdf)
        joints = [model.joints[model.getJointId(name)] for name in self._arm.joint_names]
        self._slots = [joint.idx_q for joint in joints]
        self._columns = [joint.idx_v for joint in joints]
        self._base, self._tool = model.getFrameId(self._robot.base_frame), model.getFrameId(self._arm.tool_frame)
        self._neutral: Array = pinocchio.neutral(model)
        for name, value in self._robot.postures.get("home", {}).items():
            if model.existJointName(name):
                self._neutral[model.joints[model.getJointId(name)].idx_q] = value
        self._model, self._data = model, model.createData()
