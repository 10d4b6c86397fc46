"""Trees that must be refused, with the node and why; and those that pass."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from bestman_bt.engine import NodeRegistry, XmlDocument
from bestman_bt.engine.errors import TreeProblem
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.simulation import SimulatedHolds
from bestman_bt.task_planning.symbolic.problem import Operator, PlanningProblem
from bestman_bt.task_planning.verification import highest_reach, verify, widest_grasp
from bestman_bt.world_model.semantic_map import MapFurniture, MapSurface, SemanticMap
from bestman_bt.world_model.world_model import ObjectBelief, WorldModel
from tests.robot_models import arm_model, base_model, gripper_model
from tests.task_planning.kitchen_domain import FETCH, FETCH_GOAL, OPERATORS, kitchen, operator, plan_of

DEFINITIONS = "".join(f'<BehaviorTree ID="{one.name}"><AlwaysSuccess/></BehaviorTree>' for one in OPERATORS)


def written(tree: str) -> str:
    main = f'<BehaviorTree ID="Main">{tree}</BehaviorTree>'
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}{DEFINITIONS}</root>'


def faults_of(
    tree: str,
    goal: str = FETCH_GOAL,
    robot: Any = None,
    problem: PlanningProblem | None = None,
    world: WorldModel | None = None,
) -> list[TreeProblem]:
    """What is wrong with a tree whose root node is given."""
    registry = NodeRegistry()
    registry.register(SimulatedHolds, "Holds")
    return verify(written(tree), problem or kitchen(goal), registry, cast("RobotModel | None", robot), world)


def robot_with(*arms: str, base_frame: str = "base", **others: Any) -> RobotModel:
    """``arms``: the tool frame of each; ``others``: more parts by name."""
    armed = {f"arm_{i}": arm_model(tool_frame=tool) for i, tool in enumerate(arms)}
    return RobotModel("one", REACH, base_frame, {"base": base_model(), **armed, **others})


def with_operators(goal: str, *more: Operator) -> PlanningProblem:
    problem = kitchen(goal)
    return PlanningProblem(problem.objects, problem.state, problem.goal, (*OPERATORS, *more))


def in_parallel(*branches: str) -> str:
    return f'<Parallel name="both" success_count="-1" failure_count="1">{"".join(branches)}</Parallel>'


TUCK, GO = '<SubTree ID="TuckArm"/>', '<SubTree ID="GoTo" place="table"/>'
OPEN = '<SubTree ID="OpenContainer" container="drawer_1"/>'


def test_the_tree_of_a_plan_passes() -> None:
    problem = kitchen(FETCH_GOAL)
    made = ReactiveBuilder().build(plan_of(problem, *FETCH), problem.goal)
    assert faults_of(XmlDocument([made.element]).to_xml()) == []


def test_an_unknown_thing_is_refused_with_the_closest_name() -> None:
    (fault,) = faults_of('<SubTree ID="PickUp" name="take" object="mugg" place="table"/>')
    assert (fault.node, fault.field) == ("take", "object")
    assert str(fault).endswith("unknown name 'mugg' (did you mean 'mug'?)")


def test_a_thing_of_another_type_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="OpenContainer" container="table"/>')
    assert fault.message == "OpenContainer: container should be a container, table is a place"


def test_a_missing_port_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="PickUp" object="mug"/>')
    assert (fault.field, fault.message) == ("place", "is missing; it takes a place")


def test_a_value_that_is_known_only_at_run_time_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="GoTo" place="{somewhere}"/>')
    assert "cannot be checked" in fault.message


def test_a_leaf_that_is_no_ability_is_refused_wherever_it_stands() -> None:
    (fault,) = faults_of('<Sequence><Script code="x := 1"/><AlwaysSuccess/></Sequence>')
    assert (fault.node, fault.message) == ("Script::2", "it is not an ability")


def test_an_unknown_ability_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="PickUpp" object="mug" place="table"/>')
    assert "PickUpp" in str(fault)


def test_a_plan_for_two_arms_is_refused_on_a_robot_with_one() -> None:
    lift: Operator = operator("LiftTogether", {"object": "object"}, "hand_empty", "holding({object})", parts="arm arm")
    problem = kitchen("holding(can)")
    problem = PlanningProblem(problem.objects, problem.state, problem.goal, (*OPERATORS, lift))
    tree = '<SubTree ID="LiftTogether" object="can"/>'
    xml = f"{tree}</BehaviorTree><BehaviorTree ID='LiftTogether'><AlwaysSuccess/>"
    (fault,) = faults_of(xml, robot=robot_with("tool"), problem=problem)
    assert fault.message == "it needs 2 × arm, and one has 1"
    assert faults_of(xml, robot=robot_with("tool", "tool"), problem=problem) == []


def test_two_branches_side_by_side_that_need_the_same_part_are_refused() -> None:
    tree = """<Parallel name="both" success_count="-1" failure_count="1">
        <SubTree ID="OpenContainer" name="a" container="drawer_1"/>
        <SubTree ID="TuckArm" name="b"/></Parallel>"""
    (fault,) = faults_of(tree)
    assert (fault.node, fault.message) == (
        "both",
        "OpenContainer(drawer_1) and TuckArm() side by side both need the arm",
    )


def test_all_branches_are_compared_with_all_others_however_deep_they_are() -> None:
    (fault,) = faults_of(in_parallel(TUCK, GO.replace("table", "chest/drawer_1"), f"<Sequence>{OPEN}</Sequence>"))[:1]
    assert fault.message == "TuckArm() and OpenContainer(drawer_1) side by side both need the arm"
    between = in_parallel(TUCK, "<AlwaysSuccess/>", f"<Sequence><Sequence>{OPEN}</Sequence></Sequence>")
    for tree in (
        between,
        between.replace("Parallel", "ParallelAll").replace(' success_count="-1" failure_count="1"', ""),
    ):
        assert [fault.message for fault in faults_of(tree)] == [
            "TuckArm() and OpenContainer(drawer_1) side by side both need the arm"
        ]


def test_what_needs_other_parts_and_changes_nothing_for_the_other_may_go_side_by_side() -> None:
    assert faults_of(in_parallel(TUCK, GO), "tucked and near(table)") == []
    one_after_the_other = f"<Sequence>{in_parallel(TUCK, GO)}{OPEN}</Sequence>"
    assert faults_of(one_after_the_other, "open(drawer_1) and near(table)") == []


def test_a_branch_that_changes_what_another_needs_is_refused() -> None:
    look = operator("LookAround", {}, "not tucked", "seen", parts="head")
    definition = "</BehaviorTree><BehaviorTree ID='LookAround'><AlwaysSuccess/>"
    tree = in_parallel(TUCK, '<SubTree ID="LookAround"/>') + definition
    (fault,) = faults_of(tree, problem=with_operators("tucked", look))
    assert fault.message == "TuckArm() and LookAround() side by side: one changes what the other needs"


def test_branches_may_share_a_kind_of_part_of_which_there_are_enough() -> None:
    tree = in_parallel(TUCK, OPEN)
    assert faults_of(tree, "open(drawer_1)", robot=robot_with("tool", "tool")) == []
    (fault,) = faults_of(tree, "open(drawer_1)", robot=robot_with("tool"))
    assert fault.message.endswith("both need the arm")
    (fault,) = faults_of(in_parallel(OPEN, OPEN.replace("drawer_1", "drawer_2")), robot=robot_with("tool", "tool"))
    assert fault.message.endswith("both need the base")


def test_a_part_that_is_needed_by_its_name_has_to_be_there() -> None:
    problem = with_operators("lit", operator("Light", {}, "", "lit", parts="torch"))
    tree = "<SubTree ID='Light'/></BehaviorTree><BehaviorTree ID='Light'><AlwaysSuccess/>"
    assert faults_of(tree, problem=problem, robot=robot_with("tool", torch=gripper_model())) == []
    (fault,) = faults_of(tree, problem=problem, robot=robot_with("tool", lamp=gripper_model()))
    assert fault.message == "it needs 1 × torch, and one has 0"


def test_what_is_inside_an_ability_is_its_own_business() -> None:
    problem = with_operators("lit", operator("Light", {}, "", "lit"))
    tree = "<SubTree ID='Light'/></BehaviorTree><BehaviorTree ID='Light'><Script code='x := 1'/>"
    assert faults_of(tree, problem=problem) == []


REACH = """<robot name="r">
  <joint name="a" type="fixed"><parent link="base"/><child link="b"/><origin xyz="0 0 1"/></joint>
  <joint name="s" type="prismatic"><parent link="b"/><child link="tool"/><limit lower="-0.2" upper="0.1"/></joint>
</robot>"""


def hints(height: float, size: tuple[float, float, float], kind: str = "parallel", seen: bool = True) -> list[str]:
    """Of a tree that takes the mug, of a size, from a table of a height."""
    hands = {name: gripper_model(kind=kind, max_width=width) for name, width in (("a", 0.08), ("b", 0.05))}
    robot = robot_with("tool", **hands)
    top = MapSurface("top", Pose(np.array([2.0, 3.0, height])), (1.0, 1.0))
    table = MapFurniture("table", Pose2D(1.0, 2.0, 0.3), (1.0, 1.0), height, (top,), solid_at_lidar=True)
    thing = ObjectModel("mug", (1.0, 0.0, 0.0), 0.1, 0.5, (PlacedShape(Box(size), Pose()),))
    small = ObjectModel("mug", (1.0, 0.0, 0.0), 0.1, 0.5, (PlacedShape(Box((0.01, 0.01, 0.01)), Pose()),))
    world = WorldModel(SemanticMap(np.zeros((0, 4)), {"table": table}), {"mug": small if seen else thing})
    if seen:
        world.objects["mug"] = ObjectBelief("mug", thing, Pose(), 0.9, 0.01, 1.0, "table/top")
    tree = f'<Sequence>{GO}<SubTree ID="PickUp" name="take" object="mug" place="table"/></Sequence>'
    problem = kitchen("holding(mug)", "on(mug, table)")
    faults = faults_of(tree, problem=problem, robot=robot, world=world)
    assert all((fault.severity, fault.node) == ("warning", "take") for fault in faults)
    return [f"{fault.field}: {fault.message}" for fault in faults]


@pytest.mark.parametrize("seen", [True, False])
def test_what_is_too_high_or_too_thick_is_hinted_at_and_no_reason_to_refuse(seen: bool) -> None:
    assert hints(1.19, (0.079, 0.3, 0.3), seen=seen) == []
    assert hints(1.19, (0.3, 0.079, 0.3), seen=seen) == []
    assert hints(1.21, (0.05, 0.05, 0.3), seen=seen) == ["place: table is 1.21 m high, the arm reaches up to 1.20 m"]
    assert hints(0.7, (0.081, 0.3, 0.01), seen=seen) == ["object: mug is 0.081 m thick, the hand opens 0.080 m"]
    assert hints(0.7, (0.3, 0.081, 0.01), kind="suction", seen=seen) == []


def test_the_hand_without_a_limit_and_no_hand_at_all() -> None:
    assert widest_grasp(robot_with("tool")) == 0.0
    assert widest_grasp(robot_with(cup=gripper_model(kind="suction", max_width=0.02))) == math.inf


def test_the_arm_that_gets_highest_counts_each_from_the_base() -> None:
    assert highest_reach(robot_with("b", "tool", base_frame="b")) == pytest.approx(0.2)
    assert highest_reach(robot_with("tool", "b")) == pytest.approx(1.2)


def test_faults_of_a_file_name_it_and_the_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.xml"
    for tree, line in (('<SubTree ID="PickUp" object="mugg"\n place="table"/>', 1), (OPEN, 0)):
        path.write_text(written(tree))
        for source in (path, str(path)):
            faults = verify(source, kitchen("on(mug, table)"), NodeRegistry())
            assert [(fault.file, fault.line) for fault in faults] == [(str(path), line)]
    assert [fault.file for fault in faults_of(OPEN, "on(mug, table)")] == ["<text>"]


def test_an_ability_says_more_of_a_failure_than_the_conditions_after_it() -> None:
    tree = """<Fallback><SubTree ID="PickUp" name="take" object="mug" place="table"/>
        <Holds name="asks" fact="near(table)"/><AlwaysFailure/></Fallback>"""
    (fault,) = faults_of(tree)
    assert (fault.node, fault.message) == ("take", "in a dry run it fails here: it needs on(mug, table)")
    (fault,) = faults_of('<Fallback><Holds name="a" fact="tucked"/><Holds name="b" fact="near(table)"/></Fallback>')
    assert (fault.node, fault.message) == ("b", "in a dry run it fails here: near(table) does not hold")
    (fault,) = faults_of("<AlwaysFailure/>")
    assert (fault.node, fault.message) == ("", "in a dry run it fails here: it fails")


def test_a_dry_run_names_the_node_whose_pre_condition_does_not_hold() -> None:
    tree = """<Sequence><SubTree ID="PickUp" name="first" object="can" place="table"/>
        <SubTree ID="PickUp" name="second" object="mug" place="chest/drawer_1"/></Sequence>"""
    (fault,) = faults_of(tree)
    assert fault.node == "second"
    assert fault.message == "in a dry run it fails here: it needs hand_empty and open(drawer_1)"


def test_a_tree_that_misses_the_goal_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="OpenContainer" container="drawer_1"/>', "on(mug, table)")
    assert fault.message == "in a dry run the goal is not reached: on(mug, table) does not hold"


def test_a_tree_that_never_ends_is_refused() -> None:
    (fault,) = faults_of("<KeepRunningUntilFailure><AlwaysSuccess/></KeepRunningUntilFailure>")
    assert fault.message == "the dry run does not end"
