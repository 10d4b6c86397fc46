from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics import AllSolutionsParameters, all_solutions
from bestman_bt.messages import Pose


@pytest.fixture(scope="module")
def branches(kinematics, arm, ready):
    return all_solutions(kinematics, kinematics.tool_pose(ready), ready, arm, np.random.default_rng(0))


def test_every_member_of_every_branch_is_a_solution_inside_the_limits(kinematics, arm, ready, branches):
    target = kinematics.tool_pose(ready)
    assert len(branches) >= 2
    for branch in branches:
        assert len(branch.family) > 10
        for q in branch.family:
            tool = kinematics.tool_pose(q)
            assert np.allclose(tool.position, target.position, atol=1e-3)
            assert abs(tool.quaternion @ target.quaternion) > 1 - 1e-5
        assert np.all(branch.family >= arm.lower)
        assert np.all(branch.family <= arm.upper)


def test_a_family_is_one_motion_and_branches_are_apart(branches):
    for i, branch in enumerate(branches):
        assert np.linalg.norm(np.diff(branch.family, axis=0), axis=1).max() < 0.4
        assert any(np.array_equal(branch.positions, q) for q in branch.family)
        for other in branches[i + 1 :]:
            apart = np.linalg.norm(branch.family[:, None] - other.family[None], axis=2)
            assert apart.min() > 0.2


def test_the_branch_of_the_reference_comes_first(ready, branches):
    assert np.abs(branches[0].positions - ready).max() < 0.1
    distances = [np.linalg.norm(branch.positions - ready) for branch in branches]
    assert distances == sorted(distances)


def test_refused_members_are_left_out(kinematics, arm, ready, branches):
    found = all_solutions(
        kinematics, kinematics.tool_pose(ready), ready, arm, np.random.default_rng(0), is_valid=lambda q: q[2] > 0.3
    )
    assert found
    assert all(np.all(branch.family[:, 2] > 0.3) for branch in found)
    assert sum(len(b.family) for b in found) < sum(len(b.family) for b in branches)


def test_an_arm_of_six_joints_has_single_solutions_and_up_to_eight_of_one_turn(ur5, rng):
    q = np.array([0.4, -1.2, 1.4, -0.9, -1.3, 0.3])
    found = all_solutions(ur5, ur5.tool_pose(q), q, ur5.arm, rng, parameters=AllSolutionsParameters(attempts=150))
    assert all(branch.family.shape == (1, 6) for branch in found)
    assert np.abs(found[0].positions - q).max() < 1e-2
    wrapped = {tuple(np.round(np.angle(np.exp(1j * branch.positions)), 1) + 0.0) for branch in found}
    assert 4 <= len(wrapped) <= 8


def test_an_unreachable_pose_has_no_branch(kinematics, arm, ready, rng):
    assert all_solutions(kinematics, Pose(np.array([3.0, 0, 0])), ready, arm, rng) == ()


def test_bad_requests_are_refused_by_name(kinematics, arm, ready, rng):
    with pytest.raises(ManipulationError, match="reference of arm joints should be finite"):
        all_solutions(kinematics, Pose(), ready * np.nan, arm, rng)
    with pytest.raises(ManipulationError, match="step should be above 0 but is 0"):
        AllSolutionsParameters(step=0)
