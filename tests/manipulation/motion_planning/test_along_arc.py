from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision import PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning import AlongArc, PlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.edge import dense_points
from bestman_bt.messages import Box, PlacedShape, Pose
from tests.manipulation.table_and_shelf import FINGERS

HINGE = np.array([0.55, 0.35, 0.45])
FORWARD = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
HANDLE = Pose((0.55, -0.05, 0.45), FORWARD.quaternion)


def about_the_hinge(distance: float, hinge: np.ndarray = HINGE) -> Pose:
    """A door 0.4 m wide whose handle comes towards the arm."""
    angle = -distance / 0.4
    turn = Pose(np.zeros(3), np.array([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]))
    return Pose(hinge) @ turn @ Pose(-hinge)


def along_a_line(distance: float) -> Pose:
    return Pose(np.array([-distance, 0.0, 0.0]))


@pytest.fixture(scope="module")
def start(kinematics, empty, ready):
    return kinematics.solve(HANDLE, ready, np.random.default_rng(3), is_valid=empty.is_free).best


@pytest.fixture(scope="module")
def empty(collision_model):
    return collision_model.world(PlanningScene(positions=FINGERS))


@pytest.mark.parametrize("motion", [about_the_hinge, along_a_line])
def test_the_tool_stays_on_the_way_of_the_handle_to_its_end(motion, kinematics, empty, arm, start):
    arc = AlongArc(kinematics, HANDLE, motion, 0.12)
    plan = arc.plan(start, arm, lambda distance: empty)
    reached = kinematics.tool_pose(plan.path[-1])
    asked = motion(0.12) @ HANDLE
    assert np.array_equal(plan.path[0], start)
    assert np.linalg.norm(reached.position - asked.position) < 2e-3
    progress = [arc.progress(q) for q in plan.path]
    assert progress[0] == pytest.approx(0.0, abs=2e-3)
    assert progress[-1] == pytest.approx(0.12, abs=2e-3)
    assert np.all(np.diff(progress) > -1e-3)
    for q in dense_points(plan.path, 0.01):
        tool = kinematics.tool_pose(q)
        off = [np.linalg.norm((motion(d) @ HANDLE).position - tool.position) for d in np.linspace(0.0, 0.12, 241)]
        assert min(off) < 2.5e-3


def test_a_tool_beside_the_way_breaks_the_constraint(kinematics, start):
    arc = AlongArc(kinematics, HANDLE, about_the_hinge, 0.2)
    assert arc.satisfied(start)
    for joint in range(7):
        assert not arc.satisfied(start + 0.05 * np.eye(7)[joint])
    assert "the tool on the handle's way of 0.20 m within 2.0 mm" in arc.description


def test_a_hand_may_turn_about_a_bar_and_no_further(kinematics, arm, empty, ready):
    turned = HANDLE @ Pose.from_xyz_rpy((0, 0, 0), (np.radians(10.0), 0, 0))
    positions = kinematics.solve(turned, ready, np.random.default_rng(3), is_valid=empty.is_free).best
    x = np.array([1.0, 0.0, 0.0])

    def may(max_turn: float) -> bool:
        return AlongArc(kinematics, HANDLE, along_a_line, 0.1, x, np.radians(max_turn)).satisfied(positions)

    assert may(15.0)
    assert not may(5.0)
    assert not AlongArc(kinematics, HANDLE, along_a_line, 0.1).satisfied(positions)
    assert len(AlongArc(kinematics, HANDLE, along_a_line, 0.1, x, np.radians(15.0)).stations()[0]) == 7


def test_what_cannot_be_followed_is_refused_with_how_far_it_goes(kinematics, collision_model, empty, arm, start):
    far = AlongArc(kinematics, HANDLE, lambda d: Pose(np.array([d, 0.0, 0.0])), 0.8)
    with pytest.raises(PlanningError, match=r"the arm follows the handle for 0\.\d\d of 0\.80 m") as refused:
        far.plan(start, arm, lambda distance: empty)
    assert refused.value.code is PlanningErrorCode.NO_PATH

    wall = SceneObstacle("wall", (PlacedShape(Box((0.1, 0.1, 0.1)), HANDLE),))
    blocked = collision_model.world(PlanningScene(positions=FINGERS, obstacles=(wall,)))
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.2)
    with pytest.raises(PlanningError, match=r"the start is in collision: .*wall"):
        arc.plan(start, arm, lambda distance: blocked)
    ahead = SceneObstacle("wall", (PlacedShape(Box((0.1, 0.1, 0.1)), along_a_line(0.18) @ HANDLE),))
    later = collision_model.world(PlanningScene(positions=FINGERS, obstacles=(ahead,)))
    with pytest.raises(PlanningError, match=r"for 0\.\d\d of 0\.20 m: refused by the validity check"):
        arc.plan(start, arm, lambda distance: later if distance > 0.1 else empty)


def test_bad_requests_are_refused_by_name(kinematics, empty, arm, start):
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.1)
    with pytest.raises(ManipulationError, match="start should be finite"):
        arc.plan(start * np.nan, arm, lambda distance: empty)
    with pytest.raises(ManipulationError, match="start should be 7 joint positions"):
        arc.plan(start[:6], arm, lambda distance: empty)
    with pytest.raises(PlanningError, match="the start breaks: the tool on the handle's way") as refused:
        arc.plan(start + 0.1, arm, lambda distance: empty)
    assert refused.value.code is PlanningErrorCode.START_VIOLATES_CONSTRAINT
    with pytest.raises(ManipulationError, match="AlongArc distance should be above 0 and finite but is 0"):
        AlongArc(kinematics, HANDLE, along_a_line, 0.0)
