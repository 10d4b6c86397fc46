"""Named network inputs, computed from an observation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.manipulation.policy.base import Observation
from bestman_bt.manipulation.policy.errors import PolicyModelError, PolicyObservationError
from bestman_bt.messages import Pose

Feature = Callable[[Observation], NDArray[np.float64]]
NEAR = 0.03
"""Metres within which ``goal_offset_near`` distinguishes distances."""


def pose_vector(pose: Pose) -> NDArray[np.float64]:
    """Return position (metres) and quaternion xyzw of ``pose``, (7,): the goal format of policies."""
    return np.concatenate([pose.position, pose.quaternion])


def pose_error(goal: Pose, tool: Pose) -> NDArray[np.float64]:
    """Return the error from tool to goal in the base frame, (6,): translation in metres and rotation vector in
    radians."""
    turn = Rotation.from_quat(goal.quaternion) * Rotation.from_quat(tool.quaternion).inv()
    return np.concatenate([goal.position - tool.position, turn.as_rotvec()])


def _goal_pose(observation: Observation) -> Pose:
    goal = observation.goal
    if goal.shape != (7,) or abs(float(np.linalg.norm(goal[3:])) - 1.0) > 1e-3:
        raise PolicyObservationError(f"the goal should be x, y, z and a unit quaternion xyzw but is {goal}")
    return Pose(goal[:3], goal[3:])


def _width(observation: Observation) -> NDArray[np.float64]:
    if observation.gripper_width is None:
        raise PolicyObservationError("the policy needs the gripper's width, which the observation lacks")
    return np.array([observation.gripper_width])


def _velocities(observation: Observation) -> NDArray[np.float64]:
    if observation.joint_velocities is None:
        raise PolicyObservationError("the policy needs the joints' velocities, which the observation lacks")
    return observation.joint_velocities


def _offset(observation: Observation) -> NDArray[np.float64]:
    offset: NDArray[np.float64] = _goal_pose(observation).position - observation.base_from_tool.position
    return offset


FEATURES: Mapping[str, Feature] = {
    "joint_positions": lambda observation: observation.joint_positions,
    "joint_velocities": _velocities,
    "gripper_width": _width,
    "tool_pose": lambda observation: pose_vector(observation.base_from_tool),
    "goal": lambda observation: observation.goal,
    "goal_error": lambda observation: pose_error(_goal_pose(observation), observation.base_from_tool),
    "goal_offset": _offset,
    "goal_offset_near": lambda observation: np.tanh(_offset(observation) / NEAR),
    "tool_axes": lambda observation: observation.base_from_tool.rotation[:, [0, 2]].T.ravel(),
}
"""``goal_error``: (6,), see ``pose_error``. ``goal_offset``: (3,) metres from the tool to the goal in the base frame;
``goal_offset_near``: the same if small, saturated beyond. ``tool_axes``: (6,) the tool's x and z axis in the base
frame. The others are the observation's own.
"""


def feature_vector(observation: Observation, names: Sequence[str]) -> NDArray[np.float64]:
    """Return the named features concatenated, (f,)."""
    unknown = [name for name in names if name not in FEATURES]
    if unknown:
        raise PolicyModelError(f"unknown features {', '.join(unknown)}; known: {', '.join(FEATURES)}")
    return np.concatenate([FEATURES[name](observation) for name in names])
