"""From a chunk to joint positions, whatever space its actions are in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.manipulation.joint_values import JointLimits, joint_vector
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.manipulation.policy.base import ActionChunk
from bestman_bt.manipulation.policy.errors import PolicyActionError
from bestman_bt.manipulation.policy.specification import ActionSpace
from bestman_bt.messages import Pose


def chunk_path(
    chunk: ActionChunk, start: NDArray[np.float64], kinematics: InverseKinematics, limits: JointLimits
) -> NDArray[np.float64]:
    """(H + 1, n) radians: ``start`` (n,), then where the arm shall be after each action, held inside the joint limits.

    Raises PolicyActionError where the actions have another number of columns than the arm has joints, or the arm
    cannot follow a twist.
    """
    count = len(limits.joint_names)
    start = joint_vector(start, count, "start")
    if chunk.space is ActionSpace.TOOL_TWIST:
        path = _along_twists(chunk, start, kinematics)
    elif chunk.actions.shape[1] != count:
        raise PolicyActionError(f"the arm has {count} joints but the actions have {chunk.actions.shape[1]} columns")
    elif chunk.space is ActionSpace.JOINT_DELTAS:
        path = start + np.concatenate([np.zeros((1, count)), np.cumsum(chunk.actions, axis=0)])
    else:
        path = np.concatenate([start[None], chunk.actions])
    path[1:] = np.clip(path[1:], limits.lower, limits.upper)
    return path


def _along_twists(chunk: ActionChunk, start: NDArray[np.float64], kinematics: InverseKinematics) -> NDArray[np.float64]:
    path = [start]
    tool = kinematics.tool_pose(start)
    for i, twist in enumerate(chunk.actions):
        turn = Rotation.from_rotvec(twist[3:] * chunk.dt) * Rotation.from_quat(tool.quaternion)
        tool = Pose(tool.position + twist[:3] * chunk.dt, turn.as_quat())
        positions = kinematics.track(tool, path[-1])
        if positions is None:
            raise PolicyActionError(f"the arm cannot follow the tool twist of action {i + 1} of {len(chunk.actions)}")
        path.append(positions)
    return np.array(path)
