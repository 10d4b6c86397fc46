"""Letting go: what is believed of it afterwards, and what is done where the hand does not let go."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.manipulation.place import PlaceOn, place_tool_poses
from behaviours.skill import SkillFailure
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import MotionErrorCode, Pose
from bestman_bt.perception.segmentation.surface_coverage import FREE, OCCUPIED
from bestman_bt.world_model.world_model import HeldObject
from tests.behaviours.scripted import ASKEW, UNDER_WAY, codes, in_base, load, map_from, register, run, scripted_skills

RELEASE = '<Release object="cup" surface="table/top"/>'
WIDTH, LET_GO, LOOSE = 0.06, 0.004, 3.0
HOVER, PRE_PLACE = 0.008, 0.12


def opened(width: float) -> SimpleNamespace:
    return SimpleNamespace(width=width)


@pytest.fixture
def skills() -> Any:
    """A robot that stands askew and holds a cup, which hangs 4 cm below its hand and 2 cm beside it."""
    skills = scripted_skills()
    tool_from_object = Pose.from_xyz_rpy((0.02, 0.0, 0.04), (math.pi, 0.0, 0.5))
    skills.held = HeldObject("cup", skills.world.models["cup"], tool_from_object, WIDTH)
    skills.base_from_tool = lambda: in_base(0.6, -0.2, 0.9)
    return skills


def test_what_was_let_go_is_believed_where_the_hand_has_left_it_in_the_map(skills: Any) -> None:
    skills.gripper.ends["release"] = [opened(0.08)]
    assert run(skills, load(skills, RELEASE)) == SUCCESS
    assert skills.held is None
    belief = skills.world.objects["cup"]
    np.testing.assert_allclose(belief.pose.position, map_from(ASKEW, 0.62, -0.2, 0.86), atol=1e-9)
    assert belief.pose.yaw == pytest.approx(ASKEW.theta - 0.5)
    assert belief.pose.tilt == pytest.approx(0.0, abs=1e-6)
    assert (belief.surface, belief.confidence, belief.stamp) == ("table/top", 1.0, skills.clock.now())
    assert belief.model is skills.world.models["cup"]
    assert skills.gripper.asked == [("release",)]


def test_what_is_caught_between_the_fingers_is_held_loosely_raised_a_little_and_let_go_once_more(skills: Any) -> None:
    skills.wrist_wrench = object()
    caught, free = opened(WIDTH + LET_GO - 1e-4), opened(WIDTH + LET_GO + 1e-4)
    skills.gripper.ends["release"] = [caught, free]
    assert run(skills, load(skills, RELEASE)) == SUCCESS
    assert skills.gripper.asked == [("release",), ("close", LOOSE), ("release",)]
    assert skills.arm.asked == [("move_until", (0.0, 0.0, 1.0), 0.02, 0.001, 4.0)]
    assert skills.held is None


def test_a_hand_that_does_not_let_go_grips_again_and_the_object_stays_in_it(skills: Any) -> None:
    held, caught = skills.held, opened(WIDTH + LET_GO - 1e-4)
    skills.gripper.ends["release"] = [caught, caught]
    assert run(skills, load(skills, RELEASE)) == FAILURE
    assert codes(skills) == ["not_released"]
    assert skills.held is held
    assert "cup" not in skills.world.objects
    assert skills.gripper.asked == [("release",), ("close", LOOSE), ("release",), ("close",)]


@pytest.mark.parametrize("failing", [0, 1])
def test_a_gripper_that_fails_leaves_the_object_in_the_hand(skills: Any, failing: int) -> None:
    skills.gripper.ends["release"] = [*[opened(WIDTH)] * failing, MotionErrorCode.BLOCKED]
    assert run(skills, load(skills, RELEASE)) == FAILURE
    assert codes(skills) == ["blocked"]
    assert skills.held is not None


def test_an_empty_hand_has_nothing_to_let_go(skills: Any) -> None:
    skills.held = None
    assert run(skills, load(skills, RELEASE)) == FAILURE
    assert codes(skills) == ["not_holding"]
    assert skills.gripper.asked == []


def test_halted_while_it_lets_go_nothing_is_under_way_and_the_second_time_works(skills: Any) -> None:
    skills.gripper.ends["release"] = [UNDER_WAY, opened(0.08)]
    tree = load(skills, RELEASE)
    assert run(skills, tree, 3) == RUNNING
    tree.halt()
    assert skills.gripper.under_way == []
    assert skills.held is not None
    assert run(skills, tree) == SUCCESS
    assert skills.held is None


@pytest.mark.parametrize("order", [1, 2, 0])
def test_an_object_is_put_down_in_every_turn_that_looks_the_same_and_from_straight_above(
    skills: Any, order: int
) -> None:
    cup = skills.held
    model = SimpleNamespace(symmetry_order=order)
    held = HeldObject("cup", model, cup.tool_from_object, WIDTH)
    goal = Pose.from_xyz_rpy((0.7, 0.1, 0.8), (0.0, 0.0, 0.9))
    poses = place_tool_poses(held, goal, above=PRE_PLACE, lift=HOVER)
    assert len(poses) == (order or 12)
    yaws = []
    for above, down in poses:
        np.testing.assert_allclose(above.position - down.position, [0.0, 0.0, PRE_PLACE], atol=1e-12)
        stood = down @ held.tool_from_object
        np.testing.assert_allclose(stood.position, goal.position + np.array([0.0, 0.0, HOVER]), atol=1e-9)
        assert stood.tilt == pytest.approx(0.0, abs=1e-6)
        yaws.append(round((stood.yaw - goal.yaw) % (2 * math.pi), 6) % round(2 * math.pi, 6))
    assert sorted(yaws) == pytest.approx([2 * math.pi * i / len(poses) for i in range(len(poses))], abs=1e-5)


class Coverage:
    """A surface of which so much of the disc at the goal is taken and free."""

    def __init__(self, taken: float, free: float, discs: int = 1) -> None:
        self._shares, self._discs = {OCCUPIED: taken, FREE: free}, discs

    def disc(self, point: np.ndarray, radius: float) -> dict[int, float]:
        return self._shares

    def free_discs(self, radius: float, point: np.ndarray) -> list[int]:
        return [0] * self._discs


@pytest.mark.parametrize(
    ("coverage", "code"),
    [
        (Coverage(0.029, 0.41), ""),
        (Coverage(0.031, 0.9), "goal_taken"),
        (Coverage(0.0, 0.39), "goal_not_seen"),
        (Coverage(0.031, 0.39), "goal_taken"),
        (Coverage(0.031, 0.9, discs=0), "surface_full"),
        (Coverage(0.029, 0.41, discs=0), ""),
    ],
)
def test_room_at_a_goal_is_seen_free_and_hardly_taken(
    skills: Any, monkeypatch: pytest.MonkeyPatch, coverage: Coverage, code: str
) -> None:
    """With a camera and a detector that see a level surface 74 cm above the floor and nothing on it."""
    plane = SimpleNamespace(height_at=lambda x, y: 0.74 + 0.01 * x)
    scene = SimpleNamespace(plane=plane, scene=None)
    view = SimpleNamespace(map_from_base=ASKEW.to_pose(), in_base=None)
    skills.camera = SimpleNamespace(capture=lambda: view)
    skills.detection = SimpleNamespace(detect=lambda *_: scene)
    monkeypatch.setattr("behaviours.manipulation.place.surface_region", lambda *_: None)
    monkeypatch.setattr("behaviours.manipulation.place.believe_surface", lambda *_: ())
    where = "bestman_bt.perception.segmentation.surface_coverage.surface_coverage"
    monkeypatch.setattr(where, lambda *_: coverage)
    goal = Pose.from_xyz_rpy(map_from(ASKEW, 0.8, 0.1, 0.7), (0.0, 0.0, ASKEW.theta + 0.4))
    body = '<FindPlacePose object="cup" surface="table" goal="{goal}" pose="{pose}"/>'
    tree = load(skills, body, goal=goal)
    assert run(skills, tree) == (FAILURE if code else SUCCESS)
    assert codes(skills) == ([code] if code else [])
    if not code:
        pose = tree.blackboard.get("pose")
        stands = 0.748 - float(skills.world.models["cup"].bounds()[0, 2])
        np.testing.assert_allclose(pose.position, map_from(ASKEW, 0.8, 0.1, stands), atol=1e-9)
        assert pose.yaw == pytest.approx(goal.yaw)


class Lower(PlaceOn):
    """The last part of it."""

    def execute(self) -> Any:
        yield from self._set_down("cup")


def test_an_object_is_lowered_by_feel_until_it_stands_and_no_farther(skills: Any) -> None:
    register(skills, Lower)
    for touched, status in ((True, SUCCESS), (False, FAILURE)):
        skills.arm.ends["move_until"] = [SimpleNamespace(touched=touched, distance=0.0041)]
        assert run(skills, load(skills, '<Lower object="cup" pose="0;0;0"/>')) == status
    assert codes(skills) == ["nothing_below"]
    assert skills.arm.asked == [("move_until", (0.0, 0.0, -1.0), 0.02, pytest.approx(0.018), 4.0)] * 2
    assert skills.gripper.asked == []


def test_what_touches_too_early_turns_in_an_ever_looser_hand_that_goes_on_down_with_it(skills: Any) -> None:
    register(skills, Lower)
    skills.gripper.model = SimpleNamespace(part=SimpleNamespace(max_force=10.0))
    ways = [0.0039, 0.001, 0.0, 0.0022]
    skills.arm.ends["move_until"] = [SimpleNamespace(touched=True, distance=way) for way in ways]
    assert run(skills, load(skills, '<Lower object="cup" pose="0;0;0"/>')) == SUCCESS
    assert skills.gripper.asked == [("close", force) for force in (10.0, 7.0, 5.0, 3.5)]
    down = [distance for _, _, _, distance, _ in skills.arm.asked]
    assert down == pytest.approx([0.018, 0.0041, 0.0031, 0.0031]), "0.9 mm that are left are not worth a motion"


def test_a_hand_that_cannot_follow_what_turns_in_it_holds_it_fast_again(skills: Any) -> None:
    register(skills, Lower)
    skills.arm.ends["move_until"] = [SimpleNamespace(touched=True, distance=0.0), MotionErrorCode.UNREACHABLE]
    assert run(skills, load(skills, '<Lower object="cup" pose="0;0;0"/>')) == FAILURE
    assert codes(skills) == ["unreachable"]
    assert skills.gripper.asked == [("close", 28.0), ("close",)]


class Down(PlaceOn):
    """The question whether the arm has room."""

    def execute(self) -> Any:
        down = Pose.from_xyz_rpy((0.5, 0.1, 0.8), (math.pi, 0.0, 0.3))
        approach: Any = SimpleNamespace(into=np.zeros((2, 7)))
        if not self._has_room_below(approach, down, 0.008, SimpleNamespace(is_free=None)):
            raise SkillFailure("no_room", "")
        yield from ()


@pytest.mark.parametrize("complete", [True, False])
def test_the_arm_has_to_have_room_as_far_down_as_it_may_feel_its_way(
    skills: Any, monkeypatch: pytest.MonkeyPatch, complete: bool
) -> None:
    register(skills, Down)
    goals: list[Pose] = []

    def path(kinematics: Any, start: Any, goal: Pose, is_free: Any) -> SimpleNamespace:
        goals.append(goal)
        return SimpleNamespace(complete=complete)

    monkeypatch.setattr("bestman_bt.manipulation.kinematics.cartesian_path.cartesian_path", path)
    status = run(skills, load(skills, '<Down object="cup" pose="0;0;0"/>'))
    assert status == (SUCCESS if complete else FAILURE)
    np.testing.assert_allclose(goals[0].position, [0.5, 0.1, 0.8 - 0.018])
