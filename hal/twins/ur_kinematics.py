"""Kinematics of a UR arm in the controller's base frame, and the torques that hold it."""

from __future__ import annotations

import numpy as np
import pinocchio
from numpy.typing import NDArray

from bestman_bt.messages import GRAVITY
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import flange_of

Array = NDArray[np.float64]
CONTROLLER_FRAME = pinocchio.SE3(pinocchio.utils.rotate("z", np.pi), np.zeros(3))
"""The controller's base frame in the URDF's ``base_link``: UR's x and y axes are reversed."""
DAMPING = 1e-3


class URKinematics:
    """Kinematics of one arm from its ``base_frame`` to its flange, the tip of its part; not thread-safe."""

    def __init__(self, model: RobotModel, arm: str) -> None:
        description = model.of(ArmModel)[arm]
        self._model = pinocchio.buildModelFromXML(model.urdf)
        self._data = self._model.createData()
        joints = [self._model.joints[self._model.getJointId(name)] for name in description.joint_names]
        self._slots, self._columns = [joint.idx_q for joint in joints], [joint.idx_v for joint in joints]
        self._base = self._model.getFrameId(description.base_frame)
        self._flange = self._model.getFrameId(flange_of(model, arm))
        self.length_error = 0.0  # metres along the flange's axis

    def pose(self, positions: Array) -> tuple[float, ...]:
        """Return x, y, z in metres and the rotation vector in radians."""
        pinocchio.framesForwardKinematics(self._model, self._data, self._all(positions))
        flange = self._origin().actInv(self._data.oMf[self._flange])
        flange.translation += flange.rotation[:, 2] * self.length_error
        return (*flange.translation.tolist(), *pinocchio.log3(flange.rotation).tolist())

    def joint_speeds(self, positions: Array, twist: Array) -> Array:
        """Return the joint speeds (6,) for a velocity of the flange (vx, vy, vz, wx, wy, wz); damped least squares."""
        pinocchio.computeJointJacobians(self._model, self._data, self._all(positions))
        pinocchio.updateFramePlacements(self._model, self._data)
        kind = pinocchio.LOCAL_WORLD_ALIGNED
        jacobian = pinocchio.getFrameJacobian(self._model, self._data, self._flange, kind)[:, self._columns]
        turn = self._origin().rotation
        wanted = np.concatenate([turn @ twist[:3], turn @ twist[3:]])
        solution: Array = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + DAMPING**2 * np.eye(6), wanted)
        return solution

    def holding_torques(self, positions: Array, added: float = 0.0) -> Array:
        """Return the torques (6,), N m, that hold the arm and its hand at rest, with ``added`` kg in the flange."""
        q = self._all(positions)
        torques = pinocchio.computeGeneralizedGravity(self._model, self._data, q)[self._columns]
        pinocchio.computeJointJacobians(self._model, self._data, q)
        pinocchio.updateFramePlacements(self._model, self._data)
        kind = pinocchio.LOCAL_WORLD_ALIGNED
        upward = pinocchio.getFrameJacobian(self._model, self._data, self._flange, kind)[2, self._columns]
        loaded: Array = torques + added * GRAVITY * upward
        return loaded

    def _all(self, positions: Array) -> Array:
        q: Array = pinocchio.neutral(self._model)
        q[self._slots] = positions
        return q

    def _origin(self) -> pinocchio.SE3:
        return self._data.oMf[self._base] * CONTROLLER_FRAME
