"""The pose of an arm's flange in its own base, as arms report it."""

from __future__ import annotations

import threading

import numpy as np
import pinocchio
from numpy.typing import NDArray

from bestman_bt.robot_model import ArmModel, RobotModel


class FlangePose:
    """Forward kinematics of one arm from its ``base_frame`` to the link that its last joint moves."""

    def __init__(self, model: RobotModel, arm: str) -> None:
        description = model.of(ArmModel)[arm]
        self._model = pinocchio.buildModelFromXML(model.urdf)
        self._data = self._model.createData()
        self._lock = threading.Lock()
        self._slots = [self._model.joints[self._model.getJointId(name)].idx_q for name in description.joint_names]
        self._base = self._model.getFrameId(description.base_frame)
        self._last = self._model.getJointId(description.joint_names[-1])

    def millimetres(self, positions: NDArray[np.float64]) -> tuple[float, ...]:
        """x, y, z in millimetres; roll, pitch, yaw in radians."""
        q = pinocchio.neutral(self._model)
        q[self._slots] = positions
        with self._lock:
            pinocchio.framesForwardKinematics(self._model, self._data, q)
            flange = self._data.oMf[self._base].actInv(self._data.oMi[self._last])
        return (*(1e3 * flange.translation).tolist(), *pinocchio.rpy.matrixToRpy(flange.rotation).tolist())
