from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision import PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning import AlongArc, AlongArcParameters, PlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.edge import dense_points
from bestman_bt.messages import Box, PlacedShape, Pose
from tests.manipulation.motion_planning.joint_worlds import JointWorld
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
        off = [np.linalg.norm((motion(d) @ HANDLE).position - tool.position) for d in np.linspace(0.0, 0.12, 61)]
        assert min(off) < 2.7e-3


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


X = np.array([2.0, 0.0, 0.0])
"""Along the bar; not a unit vector."""


def at(kinematics, ready, pose: Pose) -> np.ndarray:
    return kinematics.solve(pose, ready, np.random.default_rng(3)).best


@pytest.mark.parametrize(
    ("millimetres", "satisfied", "tolerated"), [(1.9, True, True), (2.1, False, True), (2.9, False, True), (3.1, 0, 0)]
)
def test_the_tool_may_leave_its_way_by_two_millimetres_and_half_of_that_more_in_motion(
    kinematics, ready, millimetres, satisfied, tolerated
):
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.2)
    beside = Pose(np.array([-0.063, 0.0, 1e-3 * millimetres])) @ HANDLE
    positions = at(kinematics, ready, beside)
    assert arc.progress(positions) == pytest.approx(0.063, abs=1e-4)
    assert arc.satisfied(positions) is bool(satisfied)
    assert arc.tolerated(positions) is bool(tolerated)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("degrees", "satisfied", "tolerated"), [(1.4, 1, 1), (1.6, 0, 1), (2.1, 0, 1), (2.4, 0, 0)])
def test_it_may_turn_by_a_degree_and_a_half_beyond_what_the_bar_allows_either_way(
    kinematics, ready, sign, degrees, satisfied, tolerated
):
    for limit, arc in (
        (0.0, AlongArc(kinematics, HANDLE, along_a_line, 0.2)),
        (10.0, AlongArc(kinematics, HANDLE, along_a_line, 0.2, X, np.radians(10.0))),
    ):
        turned = HANDLE @ Pose.from_xyz_rpy((0, 0, 0), (sign * np.radians(limit + degrees), 0, 0))
        positions = at(kinematics, ready, turned)
        assert arc.satisfied(positions) is bool(satisfied)
        assert arc.tolerated(positions) is bool(tolerated)
    aside = HANDLE @ Pose.from_xyz_rpy((0, 0, 0), (0, sign * np.radians(degrees), 0))
    free = AlongArc(kinematics, HANDLE, along_a_line, 0.2, X, np.radians(40.0))
    assert free.satisfied(at(kinematics, ready, aside)) is bool(satisfied)


def test_the_hand_may_stand_at_each_turn_from_the_least_to_the_greatest(kinematics):
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.1, X, np.radians(10.0))
    first = arc.stations()[0]
    turns = [HANDLE.inverse() @ pose for pose in first]
    angles = [2 * np.arctan2(turn.quaternion[0], turn.quaternion[3]) for turn in turns]
    assert np.degrees(angles) == pytest.approx([-10.0, -5.0, 0.0, 5.0, 10.0])
    assert len(arc.stations()) == 11


def test_progress_is_told_between_stations_on_both_sides_of_one(kinematics, ready):
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.1)
    for distance in (0.0, 0.0425, 0.0475, 0.1):
        assert arc.progress(at(kinematics, ready, along_a_line(distance) @ HANDLE)) == pytest.approx(distance, abs=1e-4)
    assert arc.progress(at(kinematics, ready, along_a_line(0.15) @ HANDLE)) == pytest.approx(0.1)
    assert arc.progress(at(kinematics, ready, along_a_line(-0.05) @ HANDLE)) == pytest.approx(0.0)


def between(path: np.ndarray, station: int) -> np.ndarray:
    """Half-way from a station to the next; the first row is the start, the second one station 0."""
    return (path[station + 1] + path[station + 2]) / 2


def away_from(place: np.ndarray, arm) -> JointWorld:
    """Blocked within 6 mrad of a place alone."""
    return JointWorld(lambda q: np.linalg.norm(q - place) > 6e-3, arm.joint_names)


@pytest.mark.parametrize("station", [0, 4, 9])
def test_what_stands_in_the_way_between_two_stations_is_found(kinematics, empty, arm, start, station):
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.1)
    path = arc.plan(start, arm, lambda distance: empty).path
    assert len(path) == 12
    blocked = away_from(between(path, station), arm)
    assert all(blocked.is_free(q) for q in path)
    with pytest.raises(PlanningError, match=rf"touches or leaves the way 0\.{station:02d} m along it"):
        arc.plan(start, arm, lambda distance: blocked)


def test_the_way_between_two_stations_is_held_against_the_worlds_of_both_and_no_others(kinematics, arm, start):
    """The door stands elsewhere at each: what is free before a station need not be so at it."""
    arc = AlongArc(kinematics, HANDLE, along_a_line, 0.05)
    free = JointWorld(lambda q: True, arm.joint_names)
    path = arc.plan(start, arm, lambda distance: free).path
    blocked = away_from(between(path, 2), arm)
    for number in range(6):
        worlds = [blocked if k == number else free for k in range(6)]

        def world_at(distance: float, worlds: list[JointWorld] = worlds) -> JointWorld:
            return worlds[round(distance / 0.01)]

        if number in (2, 3):
            with pytest.raises(PlanningError, match=r"touches or leaves the way 0\.02 m along it"):
                arc.plan(start, arm, world_at)
        else:
            assert len(arc.plan(start, arm, world_at).path) == len(path)


def test_between_two_stations_the_tool_may_not_leave_the_way_either(kinematics, empty, arm, start):
    """Stations so far apart that the straight joint motion between them cuts the arc short by half a millimetre."""
    coarse = AlongArc(
        kinematics, HANDLE, about_the_hinge, 0.12, parameters=AlongArcParameters(station=0.04, position_tolerance=2e-4)
    )
    with pytest.raises(PlanningError, match="touches or leaves the way"):
        coarse.plan(start, arm, lambda distance: empty)


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
