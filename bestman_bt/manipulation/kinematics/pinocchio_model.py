"""The pinocchio model of a robot, shared by forward kinematics, inverse kinematics and collision worlds.

Carpentier et al., "The Pinocchio C++ library", SII 2019.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pinocchio
from numpy.typing import NDArray

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel, RobotModel


def build_model(robot: RobotModel) -> pinocchio.Model:
    """Return the kinematic tree of the whole robot. Raises ManipulationError if the URDF has no ``base_frame``."""
    model = pinocchio.buildModelFromXML(robot.urdf)
    frame_index(model, robot.base_frame)
    return model


def frame_index(model: pinocchio.Model, frame: str) -> int:
    """Return the index of a frame (a link). Raises ManipulationError listing the known ones."""
    if not model.existFrame(frame):
        bodies = [f.name for f in model.frames if f.type == pinocchio.FrameType.BODY]
        raise ManipulationError(f"the robot has no frame {frame!r}; it has {', '.join(bodies)}")
    return int(model.getFrameId(frame))


def joint_index(model: pinocchio.Model, joint: str) -> int:
    """Return the index of a movable joint. Raises ManipulationError listing the known ones."""
    if not model.existJointName(joint):
        raise ManipulationError(f"the robot has no movable joint {joint!r}; it has {', '.join(list(model.names)[1:])}")
    return int(model.getJointId(joint))


def configuration(model: pinocchio.Model, positions: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the configuration vector (nq,) with the named joints at ``positions`` and all others at zero.

    Names of joints that the model lacks are an error; continuous joints are stored as (cos, sin), as pinocchio does.
    """
    q: NDArray[np.float64] = pinocchio.neutral(model)
    for name, value in positions.items():
        if not math.isfinite(value):
            raise ManipulationError(f"position of joint {name!r} should be finite but is {value}")
        joint = model.joints[joint_index(model, name)]
        if joint.nq == 2:
            q[joint.idx_q : joint.idx_q + 2] = math.cos(value), math.sin(value)
        else:
            q[joint.idx_q] = value
    return q


def joints_to_lock(model: pinocchio.Model, arm: ArmModel) -> list[int]:
    """Return the indices of all joints except the arm's."""
    moving = {joint_index(model, name) for name in arm.joint_names}
    return [index for index in range(1, model.njoints) if index not in moving]


def arm_order(reduced: pinocchio.Model, arm: ArmModel) -> NDArray[np.intp] | None:
    """Return the indices that reorder an array from the arm's order to the reduced model's, or None if both agree."""
    place = {name: reduced.joints[joint_index(reduced, name)].idx_q for name in arm.joint_names}
    order = np.argsort([place[name] for name in arm.joint_names])
    return None if np.array_equal(order, np.arange(len(order))) else order


def to_se3(pose: Pose) -> pinocchio.SE3:
    """Convert a ``Pose`` to pinocchio's SE3."""
    return pinocchio.SE3(pose.rotation, pose.position)


def to_pose(placement: pinocchio.SE3) -> Pose:
    """Convert pinocchio's placement to a ``Pose``."""
    return Pose(placement.translation, pinocchio.Quaternion(placement.rotation).coeffs())
