"""From chunks to joint positions: each action space, and inside the box."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.policy.base import ActionChunk
from bestman_bt.manipulation.policy.chunk_stream import chunk_path
from bestman_bt.manipulation.policy.errors import PolicyActionError
from bestman_bt.manipulation.policy.specification import ActionSpace, Workspace
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert


def test_deltas_add_up_and_positions_are_taken_as_they_are(expert: ReachingExpert) -> None:
    deltas = np.tile(np.linspace(-0.01, 0.01, 7), (4, 1))
    path = chunk_path(ActionChunk(deltas, 0.1, ActionSpace.JOINT_DELTAS), expert.home, expert.kinematics, expert.arm)
    np.testing.assert_allclose(path, expert.home + np.arange(5)[:, None] * deltas[0])
    same = chunk_path(
        ActionChunk(path[1:], 0.1, ActionSpace.JOINT_POSITIONS), expert.home, expert.kinematics, expert.arm
    )
    np.testing.assert_allclose(same, path)


def test_a_twist_moves_the_tool_as_it_says(expert: ReachingExpert) -> None:
    twist = np.tile([0.1, 0.0, -0.05, 0.0, 0.0, 0.3], (5, 1))
    path = chunk_path(ActionChunk(twist, 0.1, ActionSpace.TOOL_TWIST), expert.home, expert.kinematics, expert.arm)
    before, after = expert.kinematics.tool_pose(expert.home), expert.kinematics.tool_pose(path[-1])
    np.testing.assert_allclose(after.position - before.position, [0.05, 0.0, -0.025], atol=1e-4)
    turned = (after.yaw - before.yaw + np.pi) % (2 * np.pi) - np.pi
    assert turned == pytest.approx(0.15, abs=1e-3)


def test_a_path_is_held_inside_the_joint_limits(expert: ReachingExpert) -> None:
    chunk = ActionChunk(np.full((3, 7), 2.0), 0.1, ActionSpace.JOINT_DELTAS)
    path = chunk_path(chunk, expert.home, expert.kinematics, expert.arm)
    assert (path <= expert.arm.upper).all()


def test_actions_for_another_arm_are_refused(expert: ReachingExpert) -> None:
    chunk = ActionChunk(np.zeros((3, 6)), 0.1, ActionSpace.JOINT_DELTAS)
    with pytest.raises(PolicyActionError, match="7 joints but the actions have 6"):
        chunk_path(chunk, expert.home, expert.kinematics, expert.arm)


def test_leaving_the_box_between_two_waypoints_is_seen(expert: ReachingExpert) -> None:
    here = expert.kinematics.tool_pose(expert.home).position
    box = Workspace(here - 0.05, here + 0.05)
    aside = expert.home + np.array([0.3, 0, 0, 0, 0, 0, 0])
    path = np.stack([expert.home, aside, expert.home])
    outside = box.first_outside(path, expert.kinematics)
    assert outside is not None
    assert not box.contains(outside)
    assert box.first_outside(path[[0, 0]], expert.kinematics) is None


@pytest.mark.parametrize("text", ["", "1;2;3", "0;0;0;1;1;x", "0;0;0;1;1;nan", "0;0;1;1;1;0"])
def test_a_box_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ManipulationError, match=r"[Ww]orkspace"):
        Workspace.from_string(text)
