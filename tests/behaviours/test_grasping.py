"""Grasp, Holding and CheckHeld on a hand that a test closes: what is believed after each way in which it can end."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from behaviours.manipulation import grasp as grasp_module
from behaviours.manipulation.grasp import PlannedGrasp
from bestman_bt.control.gripper import HELD_WIDTH
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import MotionErrorCode, Pose
from bestman_bt.world_model.world_model import HeldObject, ObjectBelief
from tests.behaviours.scripted import ASKEW, UNDER_WAY, codes, in_base, load, map_from, run, scripted_skills

WIDTH, OPENING = 0.060, 0.078
WIDTH_TOLERANCE, CLOSED = 0.008, 0.003
GRASP = '<Grasp object="cup" grasps="{grasps}"/>'


@pytest.fixture
def skills(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A robot that stands askew before a cup; ``skills.widths``: what the fingers tell, the last one from then on."""
    skills = scripted_skills()
    skills.widths = [WIDTH]
    skills.gripper.width = lambda: skills.widths.pop(0) if len(skills.widths) > 1 else skills.widths[0]

    def moved(skill: Any, path: Any, *_: Any, **__: Any) -> Iterator[Any]:
        yield skill.skills.arm.follow("free" if isinstance(path, list) else float(path[0][0]))

    def timed(skill: Any, path: Any, *_: Any, **__: Any) -> Iterator[Any]:
        yield from ()
        return "lift"

    monkeypatch.setattr(grasp_module, "move_free", moved)
    monkeypatch.setattr(grasp_module, "follow_path", moved)
    monkeypatch.setattr(grasp_module, "approach_object", moved)
    monkeypatch.setattr(grasp_module, "timed_path", timed)
    skills.planning_scene, skills.arm_world = lambda **_: None, lambda _: None
    skills.base_from_tool = lambda: in_base(0.7, 0.0, 0.85)
    pose = Pose(map_from(ASKEW, 0.7, 0.01, 0.8))
    skills.world.objects["cup"] = ObjectBelief("cup", skills.world.models["cup"], pose, 0.9, 0.002, 40.0)
    skills.observations["cup"] = ["a view"]
    return skills


def planned(skills: Any, count: int = 2) -> list[PlannedGrasp]:
    candidate = SimpleNamespace(opening=OPENING, width=WIDTH)
    approach = SimpleNamespace(pre=np.zeros(7), into=np.arange(14.0).reshape(2, 7), out=np.full((2, 7), 99.0))
    at = skills.world.objects["cup"].pose
    tool_from_object = in_base(0.7, 0.002, 0.85).inverse() @ (ASKEW.to_pose().inverse() @ at)
    grasp: Any = PlannedGrasp(candidate, approach, at, tool_from_object)
    return [grasp] * count


def commands(controller: Any) -> list[tuple[Any, ...]]:
    return list(controller.asked)


def test_what_was_taken_is_in_the_hand_where_it_was_seen_but_centred_between_the_fingers(skills: Any) -> None:
    skills.widths = [WIDTH, WIDTH, WIDTH + 0.001]
    tree = load(skills, GRASP, grasps=planned(skills))
    assert run(skills, tree) == SUCCESS
    held = skills.held
    assert (held.name, held.model) == ("cup", skills.world.models["cup"])
    assert held.width == WIDTH + 0.001
    base_from_cup = skills.base_from_tool() @ held.tool_from_object
    np.testing.assert_allclose(base_from_cup.position, [0.7, 0.008, 0.8], atol=1e-9)
    assert "cup" not in skills.world.objects
    assert "cup" not in skills.observations
    assert tree.blackboard.get("grasps") == [], "the others were for a cup that stood"
    assert commands(skills.arm) == [("follow", "free"), ("follow", 0.0), ("follow", "lift")]
    assert [name for name, *_ in skills.gripper.asked] == ["open", "close"]


@pytest.mark.parametrize(
    ("width", "pressing", "why"),
    [
        (WIDTH - WIDTH_TOLERANCE - 1e-3, True, "it closed to 51 mm instead of 60 mm"),
        (WIDTH + WIDTH_TOLERANCE + 1e-3, True, "it stopped at 69 mm instead of 60 mm"),
        (WIDTH, False, "the fingers do not press"),
    ],
)
def test_a_hand_that_closes_on_something_else_opens_and_leaves_as_it_came(
    skills: Any, width: float, pressing: bool, why: str
) -> None:
    skills.widths, skills.gripper.pressing = [width], lambda: pressing
    skills.held = HeldObject("can", skills.world.models["cup"], Pose(), WIDTH)  # an old belief
    tree = load(skills, GRASP, grasps=planned(skills))
    assert run(skills, tree) == FAILURE
    assert codes(skills) == ["grasp_failed"]
    assert skills.failures[-1].why.endswith(why)
    assert skills.held is None
    assert "cup" in skills.world.objects
    assert commands(skills.gripper)[-1] == ("open", OPENING)
    assert commands(skills.arm)[-1] == ("follow", 7.0), "along the way in, backwards"
    assert tree.blackboard.get("grasps") == [], "the cup may have moved"
    assert run(skills, tree) == FAILURE
    assert codes(skills) == ["grasp_failed", "grasp_failed"], "without a grasp that is left the last failure is told"


def test_a_way_that_is_not_found_leaves_the_other_grasps_and_after_a_success_no_failure_is_remembered(
    skills: Any,
) -> None:
    skills.arm.ends["follow"] = [MotionErrorCode.TRACKING]
    tree = load(skills, GRASP, grasps=planned(skills, 2))
    assert run(skills, tree) == FAILURE
    assert len(tree.blackboard.get("grasps")) == 1
    assert run(skills, tree) == SUCCESS
    skills.held = None
    assert run(skills, tree) == FAILURE
    assert codes(skills) == ["tracking", "no_grasp"]


@pytest.mark.parametrize(("width", "held"), [(WIDTH, True), (0.0, False)])
def test_a_lift_that_is_stopped_keeps_what_is_still_in_the_hand(skills: Any, width: float, held: bool) -> None:
    skills.widths = [WIDTH, WIDTH, width]
    skills.arm.ends["follow"] = [None, None, MotionErrorCode.STOPPED]
    assert run(skills, load(skills, GRASP, grasps=planned(skills))) == FAILURE
    assert codes(skills) == ["stopped"]
    assert (skills.held is not None) is held
    assert ("cup" in skills.world.objects) is not held


def test_what_is_lost_on_the_way_up_is_not_held(skills: Any) -> None:
    skills.widths = [WIDTH, WIDTH, 0.0]
    assert run(skills, load(skills, GRASP, grasps=planned(skills))) == FAILURE
    assert codes(skills) == ["grasp_failed"]
    assert skills.held is None


@pytest.mark.parametrize(("part", "step"), [("gripper", "open"), ("arm", "follow"), ("gripper", "close")])
def test_halted_at_any_step_nothing_is_under_way_and_nothing_held(skills: Any, part: str, step: str) -> None:
    getattr(skills, part).ends[step] = [UNDER_WAY]
    tree = load(skills, GRASP, grasps=planned(skills))
    assert run(skills, tree, 5) == RUNNING
    tree.halt()
    assert getattr(skills, part).under_way == []
    assert skills.held is None


@pytest.mark.parametrize(("mass", "beside", "force"), [(0.1, 0.0, 20.0), (0.4, 0.03, None), (9.0, 0.1, 70.0)])
def test_the_hand_closes_as_hard_as_the_weight_beside_the_pads_asks_between_its_limits(
    skills: Any, mass: float, beside: float, force: float | None
) -> None:
    belief = skills.world.objects["cup"]
    object.__setattr__(belief, "model", SimpleNamespace(mass=mass, collision=()))
    skills.widths = [0.0]  # it takes nothing
    (grasp,) = planned(skills, 1)
    object.__setattr__(grasp, "tool_from_object", Pose(np.array([0.6 * beside, -0.8 * beside, 0.5])))
    run(skills, load(skills, GRASP, grasps=[grasp]))
    (closed,) = [asked for asked in skills.gripper.asked if asked[0] == "close"]
    by_weight = 4.0 * mass * 9.81 * beside / (skills.gripper_model.part.pad_size[1] / 2)
    assert closed[1] == pytest.approx(by_weight if force is None else force)
    if force is None:
        assert 20.0 < by_weight < 70.0
    run(skills, load(skills, '<Grasp object="cup" grasps="{grasps}" force="33"/>', grasps=[grasp]))
    assert [asked for asked in skills.gripper.asked if asked[0] == "close"][-1] == ("close", 33.0)


@pytest.mark.parametrize(("width", "closed"), [(CLOSED - 5e-4, True), (CLOSED + 5e-4, False)])
def test_a_thing_without_a_model_is_held_unless_the_hand_is_shut(skills: Any, width: float, closed: bool) -> None:
    object.__setattr__(skills.world.objects["cup"], "recognised", False)
    skills.widths = [skills.gripper_model.part.min_width + width]
    assert run(skills, load(skills, GRASP, grasps=planned(skills))) == (FAILURE if closed else SUCCESS)


@pytest.mark.parametrize(
    ("off", "held"),
    [(WIDTH_TOLERANCE - 1e-4, True), (WIDTH_TOLERANCE + 1e-4, False), (-WIDTH_TOLERANCE + 1e-4, True),
     (-WIDTH_TOLERANCE - 1e-4, False)],
)  # fmt: skip
@pytest.mark.parametrize("leaf", ['<Holding object="cup"/>', '<CheckHeld object="cup" look="false"/>'])
def test_a_grip_holds_within_the_tolerance_and_what_is_lost_is_forgotten(
    skills: Any, off: float, held: bool, leaf: str
) -> None:
    assert (HELD_WIDTH.problem(WIDTH + off, WIDTH) == "") is held
    skills.held = HeldObject("cup", skills.world.models["cup"], Pose(), WIDTH)
    skills.widths = [WIDTH + off]
    assert run(skills, load(skills, leaf)) == (SUCCESS if held else FAILURE)
    assert (skills.held is not None) is held
    assert codes(skills) == ([] if held else ["object_lost"])
    skills.held = HeldObject("can", skills.world.models["cup"], Pose(), WIDTH)
    skills.widths = [WIDTH]
    assert run(skills, load(skills, leaf)) == FAILURE
    assert codes(skills)[-1] == "not_holding"
    assert skills.held.name == "can"


@pytest.mark.parametrize(("pressed", "held"), [((True, True), True), ((True, False), False), ((False, True), False)])
def test_every_pad_has_to_be_pressed(skills: Any, pressed: tuple[bool, ...], held: bool) -> None:
    skills.held = HeldObject("cup", skills.world.models["cup"], Pose(), WIDTH)
    skills.tactile = [SimpleNamespace(name=f"pad_{i}", pressed=lambda p=p: p) for i, p in enumerate(pressed)]
    tree = load(skills, '<CheckHeld object="cup" look="false" evidence="{evidence}"/>')
    assert run(skills, tree) == (SUCCESS if held else FAILURE)
    assert tree.blackboard.get("evidence") == "width, touch"
    if not held:
        assert f"nothing presses on pad_{pressed.index(False)}" in skills.failures[-1].why
