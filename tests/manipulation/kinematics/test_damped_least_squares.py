from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel
from tests.manipulation.fixed_ur5 import fixed_ur5
from tests.robot_models import with_limits


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


def test_an_unreachable_pose_has_no_solution_and_reports_how_near_it_came(kinematics, ready, rng):
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


BENT = np.array([0.4, -1.2, 1.4, -0.9, -1.3, 0.3])
"""Of the UR5: far from its singularities and from all limits."""


@pytest.mark.parametrize(("turn", "followed"), [(0.295, True), (0.305, False), (0.44, False), (-0.295, True)])
def test_tracking_moves_no_joint_by_more_than_its_step(ur5, turn, followed):
    """An arm of six joints has one solution nearby: the joint that was turned."""
    wanted = BENT + turn * np.eye(6)[1]
    found = ur5.track(ur5.tool_pose(wanted), BENT)
    assert (found is not None) is followed
    assert found is None or np.allclose(found, wanted, atol=1e-3)


@pytest.mark.parametrize("limit", ["lower", "upper"])
def test_tracking_goes_on_from_a_start_inside_the_margin_and_keeps_to_the_limit(limit):
    """The elbow stands 5 mrad from its limit, nearer than the 20 mrad that solutions keep."""
    robot = fixed_ur5()
    arm, away = robot.of(ArmModel)["arm"], -1.0 if limit == "lower" else 1.0
    bound = getattr(arm, limit).copy()
    bound[2] = BENT[2] + 0.005 * away
    kinematics = DampedLeastSquares(replace(robot, parts={**robot.parts, "arm": with_limits(arm, **{limit: bound})}))
    wanted = BENT + 0.02 * np.eye(6)[4]
    assert np.allclose(kinematics.track(kinematics.tool_pose(wanted), BENT), wanted, atol=1e-3)
    assert kinematics.track(kinematics.tool_pose(BENT + 0.02 * away * np.eye(6)[2]), BENT) is None


def test_a_joint_of_little_travel_is_solved_in_its_middle_half(rng):
    robot = fixed_ur5()
    arm = robot.of(ArmModel)["arm"]
    lower, upper = arm.lower.copy(), arm.upper.copy()
    lower[0], upper[0] = BENT[0] - 0.015, BENT[0] + 0.015
    kinematics = DampedLeastSquares(replace(robot, parts={"arm": with_limits(arm, lower=lower, upper=upper)}))
    for turn in (-0.007, 0.0, 0.007):
        found = kinematics.solve(kinematics.tool_pose(BENT + turn * np.eye(6)[0]), BENT, rng)
        assert found.best[0] == pytest.approx(BENT[0] + turn, abs=1e-3)


def test_the_closest_approach_is_that_of_all_attempts(kinematics, ready):
    folded = Pose(np.array([0.1, 0.0, 0.05]), kinematics.tool_pose(ready).quaternion)
    misses = []
    for attempts in range(1, 9):
        result = kinematics.solve(folded, ready, np.random.default_rng(5), attempts=attempts)
        misses.append(result.position_error + result.rotation_error)
    assert misses == sorted(misses, reverse=True)
    assert misses[-1] < misses[0]


def test_every_refused_solution_is_counted_and_none_is_one_too_many(kinematics, ready):
    target, tried = kinematics.tool_pose(ready), []
    result = kinematics.solve(target, ready, np.random.default_rng(0), is_valid=lambda q: tried.append(q), attempts=6)
    assert result.rejected == len(tried) > 1
    assert len(kinematics.solve(target, ready, np.random.default_rng(0), count=2).solutions) == 2


def test_manipulability_vanishes_at_a_singularity(kinematics, ready):
    stretched = np.array([0.0, 0.0, 0.0, -0.07, 0.0, 0.0, 0.0])
    assert kinematics.manipulability(ready) > 0.05
    assert kinematics.manipulability(stretched) < 0.02


def test_a_base_that_is_not_the_root_of_the_arm_is_taken_into_account(diff_panda):
    kinematics = DampedLeastSquares(diff_panda)
    home = diff_panda.posture("home", diff_panda.of(ArmModel)["arm"].joint_names)
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


def test_the_jacobian_reports_how_the_tool_moves(kinematics, ready, rng):
    jacobian = kinematics.jacobian(ready)
    for _ in range(5):
        step = rng.normal(0.0, 1e-5, 7)
        before, after = kinematics.tool_pose(ready), kinematics.tool_pose(ready + step)
        moved = before.inverse() @ after
        assert np.allclose(moved.position, jacobian[:3] @ step, atol=1e-9)
        assert np.allclose(2 * moved.quaternion[:3], jacobian[3:] @ step, atol=1e-9)
