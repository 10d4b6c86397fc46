"""A push on an arm that a test ends: where the object is believed to be then, and what is told."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from behaviours.arm_motion import timed_path
from behaviours.manipulation import push as push_module
from behaviours.manipulation.push import Push, PushPlan
from behaviours.parameters import SkillParameters
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import MotionErrorCode, Pose
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief
from tests.behaviours.scripted import (
    ASKEW,
    UNDER_WAY,
    DeclaredContacts,
    codes,
    in_base,
    load,
    map_from,
    register,
    run,
    scripted_skills,
)

WAY = np.array([math.cos(0.4), math.sin(0.4), 0.0])
"""Of the push, in the base frame."""
GAP, DISTANCE = 0.01, 0.12
EDGE, SHORTEST = 0.03, 0.004


class Planned(Push):
    """A push whose plan is there already."""

    def _plan(self, belief: ObjectBelief, goal: Pose) -> PushPlan:
        return PushPlan(np.zeros(7), np.zeros((2, 7)), WAY, GAP, DISTANCE, 0.0)

    def _withdraw(self, name: str, plan: PushPlan) -> Any:
        yield self.skills.arm.follow("back")


@pytest.fixture
def skills(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A robot that stands askew, has seen a cup 0.7 m before it, and whose motions are no matter."""
    skills = scripted_skills()
    register(skills, Planned)

    def moved(skill: Any, *_: Any, **__: Any) -> Iterator[Any]:
        yield skill.skills.arm.follow("there")

    monkeypatch.setattr(push_module, "move_free", moved)
    monkeypatch.setattr(push_module, "follow_path", moved)
    monkeypatch.setattr(push_module, "approach_object", moved)
    scene = SimpleNamespace(obstacles=(), adding=lambda *_: None)
    skills.planning_scene, skills.arm_world = lambda **_: scene, lambda _: None
    skills.base_from_tool = lambda: in_base(0.5, 0.0, 0.8)
    pose = Pose.from_xyz_rpy(map_from(ASKEW, 0.7, 0.0, 0.8), (0.0, 0.0, 0.3))
    model = skills.world.models["cup"]
    skills.world.objects["cup"] = ObjectBelief("cup", model, pose, 0.9, 0.002, 40.0, None)
    return skills


def goal_of(skills: Any) -> Pose:
    stood = skills.world.objects["cup"].pose
    return Pose(stood.position + ASKEW.to_pose().rotation @ (DISTANCE * WAY))


def push(skills: Any, **entries: Any) -> Any:
    ports = " ".join(f'{name}="{{{name}}}"' for name in entries)
    return load(skills, f'<Planned object="cup" pushed="{{pushed}}" {ports}/>', **entries)


def outcome(distance: float, touched: bool = False) -> SimpleNamespace:
    return SimpleNamespace(distance=distance, touched=touched, force=np.array([3.0, 4.0, 0.0]))


@pytest.mark.parametrize("went", [GAP + DISTANCE, GAP + 0.05, GAP - 0.002])
def test_what_was_pushed_is_believed_as_far_on_in_the_map_as_the_hand_went_with_it(skills: Any, went: float) -> None:
    stood = skills.world.objects["cup"]
    skills.arm.ends["move_until"] = [outcome(went)]
    skills.contacts = contacts = DeclaredContacts()
    tree = push(skills, goal=goal_of(skills), speed=0.04, max_force=9.0)
    assert run(skills, tree) == SUCCESS
    assert [(one.kind, one.max_force) for one in contacts.declared] == [("push", 109.0), ("support", 109.0)]
    belief, pushed = skills.world.objects["cup"], max(0.0, went - GAP)
    x, y, _ = 0.7 * np.array([1.0, 0.0, 0.0]) + pushed * WAY
    np.testing.assert_allclose(belief.pose.position, map_from(ASKEW, x, y, 0.8), atol=1e-9)
    np.testing.assert_allclose(belief.pose.quaternion, stood.pose.quaternion)
    assert (belief.position_std, belief.stamp, belief.confidence) == (0.01, skills.clock.now(), 0.9)
    assert tree.blackboard.get("pushed") == pytest.approx(pushed)
    (asked,) = [asked for asked in skills.arm.asked if asked[0] == "move_until"]
    assert asked[2:] == (0.04, GAP + DISTANCE, 9.0)


def test_a_resistance_is_reported_after_the_hand_is_back_and_how_far_it_went_is_believed(skills: Any) -> None:
    skills.arm.ends["move_until"] = [outcome(GAP + 0.05, touched=True)]
    assert run(skills, push(skills, goal=goal_of(skills))) == FAILURE
    assert codes(skills) == ["blocked"]
    assert skills.failures[-1].why == "the cup resists with 5 N after 5 of 12 cm"
    assert skills.arm.asked[-1] == ("follow", "back")
    moved = skills.world.objects["cup"].pose.position - map_from(ASKEW, 0.7, 0.0, 0.8)
    assert np.linalg.norm(moved) == pytest.approx(0.05)


def test_an_arm_that_reaches_no_further_is_back_before_it_fails_and_how_far_it_went_is_believed(skills: Any) -> None:
    places = [np.array([0.5, 0.0, 0.8]), np.array([0.5, 0.0, 0.8]) + (GAP + 0.05) * WAY]
    skills.base_from_tool = lambda: Pose(places.pop(0))
    skills.arm.ends["move_until"] = [MotionErrorCode.UNREACHABLE]
    assert run(skills, push(skills, goal=goal_of(skills))) == FAILURE
    assert codes(skills) == [MotionErrorCode.UNREACHABLE]
    assert skills.arm.asked[-1] == ("follow", "back")
    moved = skills.world.objects["cup"].pose.position - map_from(ASKEW, 0.7, 0.0, 0.8)
    assert np.linalg.norm(moved) == pytest.approx(0.05)


def test_a_belief_less_certain_than_the_push_keeps_its_uncertainty(skills: Any) -> None:
    vague = skills.world.objects["cup"]
    object.__setattr__(vague, "position_std", 0.05)
    skills.arm.ends["move_until"] = [outcome(GAP + DISTANCE)]
    assert run(skills, push(skills, goal=goal_of(skills))) == SUCCESS
    assert skills.world.objects["cup"].position_std == 0.05


def test_halted_while_it_pushes_the_arm_is_stopped_and_the_next_push_begins_anew(skills: Any) -> None:
    stood = skills.world.objects["cup"]
    skills.arm.ends["move_until"] = [UNDER_WAY, outcome(GAP + DISTANCE)]
    tree = push(skills, goal=goal_of(skills))
    assert run(skills, tree, 5) == RUNNING
    tree.halt()
    assert skills.arm.under_way == []
    assert skills.world.objects["cup"] is stood
    assert run(skills, tree) == SUCCESS


@pytest.mark.parametrize(("away", "code"), [(SHORTEST - 1e-4, ""), (SHORTEST + 1e-4, "moved")])
def test_what_is_at_its_goal_is_left_alone(skills: Any, away: float, code: str) -> None:
    skills.arm.ends["move_until"] = [outcome(GAP)]
    goal = Pose(skills.world.objects["cup"].pose.position + np.array([0.0, away, 0.5]))
    assert run(skills, push(skills, goal=goal)) == SUCCESS
    assert bool(skills.arm.asked) is bool(code)


def test_a_full_hand_does_not_push(skills: Any) -> None:
    skills.held = HeldObject("can", skills.world.models["cup"], Pose(), 0.05)
    assert run(skills, push(skills, goal=goal_of(skills))) == FAILURE
    assert codes(skills) == ["hand_not_empty"]
    assert skills.gripper.asked == []


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_goal_is_refused_where_the_object_would_stand_too_near_to_any_edge(
    skills: Any, axis: int, side: float
) -> None:
    furniture, surface = skills.world.surface("table")
    frame = furniture.pose.to_pose() @ surface.pose
    belief = skills.world.objects["cup"]
    half = float(belief.model.size[:2].max()) / 2
    object.__setattr__(belief, "surface", "table/top")
    object.__setattr__(belief, "pose", frame @ Pose(np.array([0.0, 0.0, 0.05])))
    for spare, status in ((1e-3, SUCCESS), (-1e-3, FAILURE)):
        local = np.array([0.0, 0.0, 0.05])
        local[axis] = side * (surface.size[axis] / 2 - half - EDGE - spare)
        skills.arm.ends["move_until"] = [outcome(GAP)]
        assert run(skills, push(skills, goal=frame @ Pose(local))) == status
        object.__setattr__(skills.world.objects["cup"], "pose", belief.pose)
    assert codes(skills) == ["off_surface"]


def test_a_straight_way_at_a_share_of_the_usual_speed_takes_that_share_of_the_acceleration_too() -> None:
    asked: list[Any] = []
    skills = SimpleNamespace(
        arm_positions=lambda: np.full(7, 0.1),
        arm_model=None,
        motion_planning=SimpleNamespace(follow_path=None),
        parameters=SkillParameters(),
    )
    skill: Any = SimpleNamespace(skills=skills, compute=lambda *arguments: asked.extend(arguments))
    next(timed_path(skill, np.zeros((3, 7)), cast(Any, None), speed=0.35))
    *_, waypoints, _, _, scale = asked
    np.testing.assert_array_equal(waypoints[:, 0], [0.1, 0.0, 0.0])
    assert scale.velocity == pytest.approx(0.35 * 0.5)
    assert scale.acceleration == pytest.approx(0.35 * 0.35)
