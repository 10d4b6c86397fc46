"""The picking expert: when it goes down, closes and lifts; and what the shipped policy has learned from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.manipulation.policy.base import Observation
from bestman_bt.manipulation.policy.errors import PolicyObservationError
from bestman_bt.manipulation.policy.policy_file import load_policy
from bestman_bt.manipulation.policy.training.picking import ExpertPolicy, PickedObject, PickingExpert, PickState
from bestman_bt.manipulation.policy.training.reaching import ReachingExpert
from bestman_bt.messages import Pose

CUP = PickedObject("cup", rise=0.02, width=0.066, opening=0.08)
SHIPPED = Path(__file__).parents[3] / "assets/policies/pick_cup_diff_panda.onnx"
GOAL = Pose(np.array([0.6, 0.1, 0.8]))


@pytest.fixture(scope="module")
def picker(expert: ReachingExpert) -> PickingExpert:
    return PickingExpert(expert.kinematics, expert.arm, expert.home, CUP)


def at_rest(picker: PickingExpert, tool: Pose, width: float = CUP.opening) -> PickState:
    found = picker.kinematics.solve(tool, picker.home, np.random.default_rng(0), attempts=5)
    return PickState(found.best, np.zeros(7), np.zeros(7), width)


def over_the_grasp(picker: PickingExpert, aside: float, height: float) -> Pose:
    """The tool beside and above the grasp, turned as the expert turns it."""
    yaw = np.arctan2(GOAL.position[1], GOAL.position[0] - picker.kinematics.reach[0][0])
    return Pose.from_xyz_rpy(GOAL.position + np.array([0.0, aside, CUP.rise + height]), (np.pi, 0.0, yaw))


def heights(picker: PickingExpert, state: PickState, steps: int = 10) -> list[float]:
    found = []
    for _ in range(steps):
        state, _ = picker.step(state, GOAL)
        found.append(float(picker.kinematics.tool_pose(state.positions).position[2]))
    return found


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("seed", range(8))
def test_from_anywhere_in_the_box_it_has_the_object_lifted_within_five_seconds(
    picker: PickingExpert, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    start, goal = picker.task(rng)
    state = PickState(start, np.zeros(7), np.zeros(7), CUP.opening)
    closed_at = None
    for _ in range(60):
        state, gripper = picker.step(state, goal)
        tool = picker.kinematics.tool_pose(state.positions).position
        if gripper < 0.0 and closed_at is None:
            closed_at = tool - goal.position
        if picker.lifted(state, goal):
            break
    assert picker.lifted(state, goal)
    assert closed_at is not None
    np.testing.assert_allclose(closed_at, [0.0, 0.0, CUP.rise], atol=0.005)


def test_it_goes_down_where_it_is_aligned_and_up_where_it_is_not(picker: PickingExpert) -> None:
    aligned = at_rest(picker, over_the_grasp(picker, 0.0, 0.05))
    astray = at_rest(picker, over_the_grasp(picker, 0.03, 0.05))
    assert heights(picker, aligned)[-1] < GOAL.position[2] + CUP.rise + 0.03
    assert heights(picker, astray, 3)[-1] > GOAL.position[2] + CUP.rise + 0.05


def test_it_lifts_only_what_it_grips(picker: PickingExpert) -> None:
    low = over_the_grasp(picker, 0.0, 0.0)
    held, closing = at_rest(picker, low, CUP.width), at_rest(picker, low, CUP.width + 0.004)
    assert heights(picker, held)[-1] > low.position[2] + 0.05
    state, gripper = picker.step(closing, GOAL)
    assert gripper < 0.0
    np.testing.assert_allclose(picker.kinematics.tool_pose(state.positions).position, low.position, atol=0.002)


def test_a_demonstration_holds_what_was_seen_and_the_chunks_that_followed(picker: PickingExpert) -> None:
    demonstration = picker.demonstrate(np.random.default_rng(3))
    count, horizon = len(demonstration.observations), picker.horizon
    assert demonstration.chunks.shape == (count, horizon, 8)
    assert set(np.unique(demonstration.chunks[:, :, 7])) <= {-1.0, 1.0}
    again = picker.demonstrate(np.random.default_rng(3))
    np.testing.assert_array_equal(demonstration.chunks, again.chunks)


def test_the_shipped_policy_reports_what_the_expert_says(picker: PickingExpert) -> None:
    """At starts that it has not been trained on: within a tenth of the way, and never a closed hand up there."""
    learned, taught = load_policy(SHIPPED), ExpertPolicy(picker, "diff_panda")
    assert learned.specification.workspace == taught.specification.workspace
    misses = []
    for seed in range(7000, 7020):
        start, goal = picker.task(np.random.default_rng(seed))
        seen = picker.observation(PickState(start, np.zeros(7), np.zeros(7), CUP.opening), goal)
        said, right = learned.act(seen), taught.act(seen)
        assert said.gripper_widths is not None
        np.testing.assert_array_equal(said.gripper_widths[:4], CUP.opening)
        way = np.linalg.norm(right.actions.sum(axis=0))
        misses.append(np.linalg.norm((said.actions - right.actions).sum(axis=0)) / way)
    assert np.median(misses) < 0.15


def test_an_expert_that_sees_no_velocities_reports_it(picker: PickingExpert) -> None:
    seen = Observation(picker.home, picker.kinematics.tool_pose(picker.home), np.zeros(7), 0.08)
    with pytest.raises(PolicyObservationError, match="velocities"):
        ExpertPolicy(picker, "diff_panda").act(seen)
