"""Trees that must be refused, with the node and why; and those that pass."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

from bestman_bt.engine import NodeRegistry, XmlDocument
from bestman_bt.engine.errors import Problem as Fault
from bestman_bt.robot_model import RobotModel
from bestman_bt.task_planning.builders import ReactiveBuilder
from bestman_bt.task_planning.simulation import SimulatedHolds
from bestman_bt.task_planning.symbolic import Operator, Problem
from bestman_bt.task_planning.verification import verify
from tests.task_planning.kitchen_domain import FETCH, FETCH_GOAL, OPERATORS, kitchen, operator, plan_of

DEFINITIONS = "".join(f'<BehaviorTree ID="{one.name}"><AlwaysSuccess/></BehaviorTree>' for one in OPERATORS)


def faults_of(tree: str, goal: str = FETCH_GOAL, robot: Any = None, problem: Problem | None = None) -> list[Fault]:
    """What is wrong with a tree whose root node is given."""
    registry = NodeRegistry()
    registry.register(SimulatedHolds, "Holds")
    main = f'<BehaviorTree ID="Main">{tree}</BehaviorTree>'
    xml = f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}{DEFINITIONS}</root>'
    return verify(xml, problem or kitchen(goal), registry, cast("RobotModel | None", robot))


def robot_with(arms: int) -> Any:
    """As much of a robot as its parts are counted by."""
    named = {f"arm_{i}": None for i in range(arms)}
    return SimpleNamespace(name="one", arms=named, bases={"base": None}, grippers={}, joint_groups={}, part_names=())


def test_the_tree_of_a_plan_passes() -> None:
    problem = kitchen(FETCH_GOAL)
    made = ReactiveBuilder().build(plan_of(problem, *FETCH), problem.goal)
    assert faults_of(XmlDocument([made.element]).to_xml()) == []


def test_an_unknown_thing_is_refused_with_the_closest_name() -> None:
    (fault,) = faults_of('<SubTree ID="PickUp" name="take" object="mugg" place="table"/>')
    assert (fault.node, fault.field) == ("take", "object")
    assert str(fault).endswith("nothing is called 'mugg' (did you mean 'mug'?)")


def test_a_thing_of_another_type_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="OpenContainer" container="table"/>')
    assert "container should be a container, table is a place" in fault.message


def test_a_missing_port_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="PickUp" object="mug"/>')
    assert (fault.field, fault.message) == ("place", "is missing; it takes a place")


def test_a_value_that_is_known_only_at_run_time_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="GoTo" place="{somewhere}"/>')
    assert "cannot be checked" in fault.message


def test_a_leaf_that_is_no_ability_is_refused_wherever_it_stands() -> None:
    (fault,) = faults_of('<Sequence><Script code="x := 1"/><AlwaysSuccess/></Sequence>')
    assert (fault.node, fault.message) == ("Script::2", "it is no ability")


def test_an_unknown_ability_is_refused() -> None:
    (fault,) = faults_of('<SubTree ID="PickUpp" object="mug" place="table"/>')
    assert "PickUpp" in str(fault)


def test_a_plan_for_two_arms_is_refused_on_a_robot_with_one() -> None:
    lift: Operator = operator("LiftTogether", {"object": "object"}, "hand_empty", "holding({object})", parts="arm arm")
    problem = kitchen("holding(can)")
    problem = Problem(problem.objects, problem.state, problem.goal, (*OPERATORS, lift))
    tree = '<SubTree ID="LiftTogether" object="can"/>'
    xml = f"{tree}</BehaviorTree><BehaviorTree ID='LiftTogether'><AlwaysSuccess/>"
    (fault,) = faults_of(xml, robot=robot_with(arms=1), problem=problem)
    assert fault.message == "it needs 2 × arm, and one has 1"
    assert faults_of(xml, robot=robot_with(arms=2), problem=problem) == []


def test_two_branches_side_by_side_that_need_the_same_part_are_refused() -> None:
    tree = """<Parallel name="both" success_count="-1" failure_count="1">
        <SubTree ID="OpenContainer" name="a" container="drawer_1"/>
        <SubTree ID="TuckArm" name="b"/></Parallel>"""
    (fault,) = faults_of(tree)
    assert (fault.node, fault.message) == (
        "both",
        "OpenContainer(drawer_1) and TuckArm() side by side both need the arm",
    )


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
    assert fault.message == "in a dry run it does not end"
