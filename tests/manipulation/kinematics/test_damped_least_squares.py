from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics import DampedLeastSquares, DampedLeastSquaresParameters
from bestman_bt.messages import Pose


def test_reachable_poses_are_solved_to_a_millimetre_and_half_a_degree_inside_the_limits(kinematics, arm, ready, rng):
    solved = 0
    for q in rng.uniform(arm.lower + 0.03, arm.upper - 0.03, (150, 7)):
        target = kinematics.tool_pose(q)
        result = kinematics.solve(target, ready, rng)
        if not result.found:
            continue
        solved += 1
        reached = kinematics.tool_pose(result.best)
        assert np.linalg.norm(reached.position - target.position) < 1e-3
        assert abs(reached.quaternion @ target.quaternion) > np.cos(np.radians(0.25))
        assert np.all(result.best >= arm.lower + 0.0199)
        assert np.all(result.best <= arm.upper - 0.0199)
    assert solved >= 149


def test_the_tool_pose_agrees_with_pybullet(kinematics, arm, referee, rng):
    for q in rng.uniform(arm.lower, arm.upper, (20, 7)):
        position, quaternion = referee.tool_pose(q)
        ours = kinematics.tool_pose(q)
        assert np.allclose(ours.position, position, atol=1e-5)
        assert abs(ours.quaternion @ quaternion) > 1 - 1e-6


def test_several_solutions_are_distinct_and_ranked_by_distance_to_the_reference(kinematics, ready, rng):
    target = kinematics.tool_pose(ready)
    result = kinematics.solve(target, ready + 0.1, rng, count=5)
    distances = [np.linalg.norm(q - (ready + 0.1)) for q in result.solutions]
    assert len(result.solutions) == 5
    assert distances == sorted(distances)
    for i, a in enumerate(result.solutions):
        assert all(np.abs(a - b).max() >= 0.2 for b in result.solutions[i + 1 :])


def test_a_solution_near_the_reference_is_found_first(kinematics, ready, rng):
    result = kinematics.solve(kinematics.tool_pose(ready + 0.05), ready, rng)
    assert result.attempts == 1
    assert np.abs(result.best - ready).max() < 0.3


def test_refused_solutions_are_not_returned(kinematics, ready, rng):
    target = kinematics.tool_pose(ready)
    result = kinematics.solve(target, ready, rng, is_valid=lambda q: q[0] < -0.3)
    assert result.found
    assert result.best[0] < -0.3
    assert result.rejected >= 1


def test_an_unreachable_pose_has_no_solution_and_says_how_near_it_came(kinematics, ready, rng):
    folded = Pose(np.array([0.1, 0.0, 0.05]), kinematics.tool_pose(ready).quaternion)
    result = kinematics.solve(folded, ready, rng, attempts=5)
    assert not result.found
    assert result.attempts == 5
    assert result.position_error + result.rotation_error > 1e-3
    far = Pose(np.array([3.0, 0.0, 0.5]))
    assert kinematics.solve(far, ready, rng).attempts == 0
    with pytest.raises(LookupError, match="no inverse kinematics solution"):
        _ = result.best


def test_the_same_generator_gives_the_same_solution(kinematics, ready):
    target = kinematics.tool_pose(np.array([1.0, 0.8, -1.2, -1.9, 2.0, 2.0, -1.0]))
    first = kinematics.solve(target, ready, np.random.default_rng(3), count=4)
    kinematics.solve(kinematics.tool_pose(ready + 0.2), ready, np.random.default_rng(9), count=2)
    again = kinematics.solve(target, ready, np.random.default_rng(3), count=4)
    assert len(first.solutions) == 4
    assert np.array_equal(first.solutions, again.solutions)


def test_tracking_does_not_jump_to_another_branch(kinematics, ready):
    near = kinematics.track(kinematics.tool_pose(ready + 0.02), ready)
    assert near is not None
    assert np.abs(near - ready).max() < 0.1
    turned = ready.copy()
    turned[0] += 1.0
    assert kinematics.track(kinematics.tool_pose(turned), ready) is None


def test_manipulability_vanishes_at_a_singularity(kinematics, ready):
    stretched = np.array([0.0, 0.0, 0.0, -0.07, 0.0, 0.0, 0.0])
    assert kinematics.manipulability(ready) > 0.05
    assert kinematics.manipulability(stretched) < 0.02


def test_a_base_that_is_not_the_root_of_the_arm_is_taken_into_account(diff_panda):
    kinematics = DampedLeastSquares(diff_panda)
    home = diff_panda.posture("home", diff_panda.arms["arm"].joint_names)
    shoulder, reach = kinematics.reach
    tool = kinematics.tool_pose(home).position
    assert shoulder[2] > 0.5
    assert np.linalg.norm(tool - shoulder) < reach


def test_bad_requests_are_refused_by_name(panda, kinematics, ready, rng):
    with pytest.raises(ManipulationError, match=r"reference .* 7 joint positions .* \(3,\)"):
        kinematics.solve(kinematics.tool_pose(ready), ready[:3], rng)
    with pytest.raises(ManipulationError, match="finite"):
        kinematics.solve(kinematics.tool_pose(ready), ready * np.nan, rng)
    with pytest.raises(ManipulationError, match="base_from_tool should be finite"):
        kinematics.solve(Pose(np.array([np.nan, 0, 0])), ready, rng)
    with pytest.raises(ManipulationError, match="max_iterations should be at least 1"):
        DampedLeastSquaresParameters(max_iterations=0)
    with pytest.raises(ManipulationError, match="no arm 'left'; it has arm"):
        DampedLeastSquares(panda, "left")


def test_an_arm_of_six_joints_is_solved_near_its_singularities(ur5, rng):
    """Wrist aligned, elbow stretched, or both, within a hundredth of a radian."""
    solved = 0
    start = np.array([0.0, -1.2, 1.4, -1.7, -1.57, 0.0])
    for q in rng.uniform(-2.5, 2.5, (60, 6)):
        q[[4, 2][: 1 + int(rng.integers(2))]] = rng.uniform(-0.01, 0.01)
        target = ur5.tool_pose(q)
        result = ur5.solve(target, start, rng)
        solved += result.found and result.position_error < 1e-3 and result.rotation_error < np.radians(0.5)
        assert all(np.isfinite(solution).all() for solution in result.solutions)
    assert solved >= 59


def test_the_jacobian_tells_how_the_tool_moves(kinematics, ready, rng):
    jacobian = kinematics.jacobian(ready)
    for _ in range(5):
        step = rng.normal(0.0, 1e-5, 7)
        before, after = kinematics.tool_pose(ready), kinematics.tool_pose(ready + step)
        moved = before.inverse() @ after
        assert np.allclose(moved.position, jacobian[:3] @ step, atol=1e-9)
        assert np.allclose(2 * moved.quaternion[:3], jacobian[3:] @ step, atol=1e-9)
