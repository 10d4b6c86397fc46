"""Which arm a UR's controller moves, compared with the robot file: by name, and by where each has the flange."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.robot_model.payload import flange_of
from hal.hardware.controller_facts import ArmFacts, compare_payload

FLANGE_TOLERANCE = 0.01
"""Metres: above the calibration offsets of a single arm's flange, and far below the difference of two models."""


@dataclass(frozen=True)
class URIdentity:
    """The identity reported by the controller.

    ``model``, ``serial_number``: from its dashboard. ``joints``: (6,) rad. ``tool_pose``, ``tcp_offset``: of the active
    tool in the controller's base frame, and in the flange; metres and rotation vectors. ``payload``: configured load at
    its flange, kg.
    """

    model: str
    serial_number: str
    joints: list[float]
    tool_pose: list[float]
    tcp_offset: list[float]
    payload: float

    def mismatch(self, robot: RobotModel, arm: str, model: str | None) -> str | None:
        """Return the difference from the arm of the robot file, whose option ``model`` may name it, or None."""
        told = f"the controller calls its arm {self.model}, serial number {self.serial_number}"
        if model is not None and _family(self.model) != _family(model):
            return f"{told}; the option 'model' says {model}"
        apart = self._flange_apart(robot, arm)
        if apart > FLANGE_TOLERANCE:
            return (
                f"the controller has its flange {1000 * apart:.0f} mm from where the robot file's arm has it: it moves "
                f"another arm, or one that is calibrated otherwise ({told}). ur3e_arm, ur5e_arm and ur10e_arm are the "
                "e-series; ur5_arm and ur10_arm are the arms before it"
            )
        weighed = compare_payload(robot, arm, self.arm_facts())
        return weighed.text if weighed is not None and not weighed.agrees else None

    def arm_facts(self) -> ArmFacts:
        """Return the same in the frames of the URDF, whose base counts x and y the other way round."""
        base = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.pi))
        tool, offset = base @ _pose(self.tool_pose), _pose(self.tcp_offset)
        return ArmFacts(np.array(self.joints), tool, offset, payload=self.payload)

    def _flange_apart(self, robot: RobotModel, arm: str) -> float:
        """Metres between the flange by the controller and by the robot file."""
        import pinocchio

        description = robot.of(ArmModel)[arm]
        model = pinocchio.buildModelFromXML(robot.urdf)
        data, q = model.createData(), pinocchio.neutral(model)
        for name, position in zip(description.joint_names, self.joints, strict=True):
            q[model.joints[model.getJointId(name)].idx_q] = position
        pinocchio.framesForwardKinematics(model, data, q)
        base = data.oMf[model.getFrameId(description.base_frame)]
        ours = base.actInv(data.oMf[model.getFrameId(flange_of(robot, arm))]).translation
        tool, offset = (
            pinocchio.SE3(pinocchio.exp3(np.array(pose[3:])), np.array(pose[:3]))
            for pose in (self.tool_pose, self.tcp_offset)
        )
        theirs = (tool * offset.inverse()).translation * np.array([-1.0, -1.0, 1.0])  # they count x and y the other way
        return float(np.linalg.norm(ours - theirs))


def _pose(values: list[float]) -> Pose:
    """Of a place in metres and a rotation vector."""
    return Pose(np.array(values[:3]), Rotation.from_rotvec(values[3:]).as_quat())


def _family(model: str) -> str:
    """The dashboard's names have no "e"; versions differ in that."""
    return model.strip().upper().removesuffix("E")
