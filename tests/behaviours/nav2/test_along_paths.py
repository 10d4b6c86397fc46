"""What is asked of a path from where the base is on it, not from where the path begins."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.world_model.world_model import BasePose
from tests.behaviours.scripted import codes, load, run, scripted_skills

LENGTH = 6.0


class Ground:
    """A costmap on which the base touches whatever is nearer than 20 cm to one of ``points``."""

    def __init__(self, *points: tuple[float, float]) -> None:
        self._points = np.array(points).reshape(-1, 2)

    def footprint_clearance(self, poses: np.ndarray) -> np.ndarray:
        if not len(self._points):
            return np.full(len(poses), 9.0)
        return np.linalg.norm(poses[:, None, :2] - self._points[None], axis=2).min(axis=1) - 0.2


@pytest.fixture
def skills() -> Any:
    skills = scripted_skills("navigate_kitchen")
    skills.seen_costmap = lambda: Ground()
    return skills


def straight(length: float = LENGTH, heading: float = 2.0) -> Path2D:
    end = Pose2D(length * math.cos(heading), length * math.sin(heading), heading)
    return Path2D(np.array([[0.0, 0.0], [end.x, end.y]]), end)


def on(path: Path2D, metres: float, beside: float = 0.1) -> Pose2D:
    """So many metres along a straight path, and a little beside it."""
    return path.goal @ Pose2D(metres - path.length, beside, 0.3)


def stand(skills: Any, pose: Pose2D) -> None:
    skills.world.base = BasePose(pose, 0.01, 0.01, skills.clock.now())


@pytest.mark.parametrize(
    ("ahead", "obstacle", "valid"),
    [
        (1.0, 3.9, False),
        (1.0, 4.4, True),  # the lookahead is counted from the base, which is 3 m along
        (2.0, 4.4, False),
        (1.0, 2.0, True),  # behind the base
        (-1.0, 2.0, True),
        (-1.0, 5.9, False),
    ],
)
def test_a_path_is_valid_as_far_ahead_of_the_base_as_is_asked(
    skills: Any, ahead: float, obstacle: float, valid: bool
) -> None:
    path = straight()
    stand(skills, on(path, 3.0))
    skills.seen_costmap = lambda: Ground(tuple(on(path, obstacle, 0.0).xy))
    body = '<IsPathValid path="{path}" max_lookahead_distance="{ahead}" collision_poses="{where}"/>'
    tree = load(skills, body, path=path, ahead=ahead)
    assert run(skills, tree) == (SUCCESS if valid else FAILURE)
    where = tree.blackboard.get("where")
    assert len(where) == (0 if valid else 1)
    if not valid:
        assert codes(skills) == ["path_blocked"]
        assert where[0].distance_to(on(path, obstacle - 0.2, 0.0)) < 0.06
        assert where[0].theta == pytest.approx(path.goal.theta)


def test_a_base_that_stands_within_a_margin_may_leave_it_but_not_come_nearer(skills: Any) -> None:
    path = straight()
    stand(skills, on(path, 3.0, 0.0))
    for obstacle, status in ((2.9, SUCCESS), (3.1, FAILURE)):
        skills.seen_costmap = lambda obstacle=obstacle: Ground(tuple(on(path, obstacle, 0.0).xy))
        assert run(skills, load(skills, '<IsPathValid path="{path}"/>', path=path)) == status


@pytest.mark.parametrize(("metres", "near", "status"), [(4.9, 1.0, FAILURE), (5.1, 1.0, SUCCESS), (0.0, 6.2, SUCCESS)])
def test_a_goal_is_near_by_what_is_left_of_the_path(skills: Any, metres: float, near: float, status: int) -> None:
    path = straight()
    stand(skills, on(path, metres))
    tree = load(skills, '<IsGoalNearby path="{path}" proximity_threshold="{near}"/>', path=path, near=near)
    assert run(skills, tree) == status
    assert codes(skills) == ([] if status == SUCCESS else ["not_near"])


def hairpin() -> Path2D:
    """Four metres up, 10 cm across and four metres down again."""
    return Path2D(np.array([[0.0, 0.0], [0.0, 4.0], [0.1, 4.0], [0.1, 0.0]]), Pose2D(0.1, 0.0, -math.pi / 2))


def test_on_a_path_that_comes_back_close_by_the_place_goes_on_from_the_last_one(skills: Any) -> None:
    path = hairpin()
    body = """<TruncatePathLocal input_path="{path}" output_path="{cut}" distance_forward="1" distance_backward="0.5"
      max_robot_pose_search_dist="1.5"/>"""
    tree = load(skills, body, path=path)
    for y, strand in ((0.5, 0.0), (1.5, 0.0), (2.5, 0.0), (3.5, 0.0)):
        stand(skills, Pose2D(0.08, y, 0.0))  # nearer to the other strand
        assert run(skills, tree) == SUCCESS
        cut = tree.blackboard.get("cut")
        assert cut.points[0][0] == strand
        assert cut.points[0][1] == pytest.approx(y - 0.5)
        assert cut.length == pytest.approx(1.5)
    tree.blackboard.set("path", hairpin())
    stand(skills, Pose2D(0.08, 0.3, 0.0))
    assert run(skills, tree) == SUCCESS
    assert tree.blackboard.get("cut").points[0][1] == pytest.approx(0.0), "a new path begins at its beginning"


@pytest.mark.parametrize(("forward", "length"), [(1.0, 3.0), (-1.0, 5.0), (9.0, 5.0)])
def test_what_is_cut_out_reaches_so_far_ahead_of_the_base_and_behind_it(
    skills: Any, forward: float, length: float
) -> None:
    path = straight()
    stand(skills, on(path, 3.0))
    body = '<TruncatePathLocal input_path="{path}" output_path="{cut}" distance_forward="{f}" distance_backward="2"/>'
    tree = load(skills, body, path=path, f=forward)
    assert run(skills, tree) == SUCCESS
    cut = tree.blackboard.get("cut")
    assert cut.length == pytest.approx(length)
    np.testing.assert_allclose(cut.points[0], on(path, 1.0, 0.0).xy, atol=1e-9)


@pytest.mark.parametrize("distance", [0.5, 6.5, 0.0])
def test_a_path_is_truncated_as_the_crow_flies_and_then_faces_its_end(skills: Any, distance: float) -> None:
    path = straight()
    tree = load(skills, '<TruncatePath input_path="{path}" output_path="{cut}" distance="{d}"/>', path=path, d=distance)
    assert run(skills, tree) == SUCCESS
    cut = tree.blackboard.get("cut")
    assert cut.length == pytest.approx(max(0.0, LENGTH - distance), abs=1e-6)
    assert cut.goal.theta == pytest.approx(path.goal.theta)


def corner() -> Path2D:
    return Path2D(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]), Pose2D(2.0, 2.0, math.pi / 2))


def test_a_corner_is_rounded_but_not_where_the_base_would_then_touch_something_and_that_is_asked(skills: Any) -> None:
    path = corner()
    ports = 'unsmoothed_path="{path}" smoothed_path="{s}" check_for_collisions="{check}" was_completed="{w}"'
    inside = Ground((1.9, 0.1))
    for ground, check, kept in ((Ground(), True, False), (inside, False, False), (inside, True, True)):
        skills.seen_costmap = lambda ground=ground: ground
        tree = load(skills, f"<SmoothPath {ports}/>", path=path, check=check)
        assert run(skills, tree) == SUCCESS
        assert (tree.blackboard.get("s") is path) is kept
        assert tree.blackboard.get("w") is not kept


@pytest.mark.parametrize(
    ("leaf", "code", "helps"),
    [
        ("WouldAPlannerRecoveryHelp", "no_path", True),
        ("WouldAPlannerRecoveryHelp", "goal_outside", False),
        ("WouldAPlannerRecoveryHelp", "", False),
        ("WouldAControllerRecoveryHelp", "blocked", True),
        ("WouldAControllerRecoveryHelp", "goal_blocked", False),
        ("AreErrorCodesPresent error_codes_to_check='lost;blocked'", "lost", True),
        ("AreErrorCodesPresent error_codes_to_check='lost;blocked'", "timeout", False),
        ("AreErrorCodesPresent", "lost", False),
    ],
)
def test_whether_a_recovery_may_help_is_reported_by_the_code(skills: Any, leaf: str, code: str, helps: bool) -> None:
    assert run(skills, load(skills, f'<{leaf} error_code="{{code}}"/>', code=code)) == (SUCCESS if helps else FAILURE)


@pytest.mark.parametrize(
    ("leaf", "left"),
    [
        ("ClearEntireCostmap", []),
        ("ClearCostmapAroundRobot reset_distance='2'", [(5.0, 5.0), (1.1, 0.0), (0.0, -1.1)]),
        ("ClearCostmapAroundPose reset_distance='1' pose='5;5;1'", [(0.0, 0.0), (1.1, 0.0), (0.0, -1.1), (-0.9, 0.9)]),
        ("ClearCostmapExceptRegion reset_distance='2'", [(0.0, 0.0), (-0.9, 0.9)]),
    ],
)
def test_what_was_seen_is_forgotten_in_a_square_or_outside_of_one(skills: Any, leaf: str, left: list[Any]) -> None:
    points = np.array([(0.0, 0.0), (5.0, 5.0), (1.1, 0.0), (0.0, -1.1), (-0.9, 0.9)])
    forgotten: list[np.ndarray] = []

    def clear(which: Any = None) -> None:
        forgotten.append(np.ones(len(points), bool) if which is None else which(points))

    skills.base.layer = SimpleNamespace(clear=clear)
    stand(skills, Pose2D(0.0, 0.0, 0.7))
    assert run(skills, load(skills, f"<{leaf}/>")) == SUCCESS
    assert [tuple(point) for point in points[~forgotten[0]]] == left
