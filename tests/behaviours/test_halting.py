"""Halted in the middle of whatever it does, a skill leaves nothing moving: at rest within half a second, for good."""

from __future__ import annotations

import pytest

from bestman_bt.engine import RUNNING
from bestman_bt.runtime.robot_session import RobotSession
from tests.behaviours.at_the_table import fastest, tick, tree_of

REST = 0.01
GRASP = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="cup" surface="table"/>
  <PlanGrasp object="cup" grasps="{grasps}"/>
  <Grasp object="cup" grasps="{grasps}"/>
</Sequence>"""


def halt_in_motion(robot: RobotSession, body: str, leaf: str, moving_for: float) -> None:
    """Tick until ``leaf`` has moved the robot for so many seconds, then halt the tree."""
    tree = robot.load(tree_of(body))
    node = next(node for node in tree.nodes if type(node).__name__ == leaf)
    moved = 0.0
    while moved < moving_for:
        assert tick(tree) == RUNNING, f"it ended before {leaf} could be halted: {robot.skills.failures}"
        if node.state == RUNNING and fastest(robot) > 5 * REST:
            moved += 0.05
    assert fastest(robot) > 5 * REST
    tree.halt()


def assert_rests(robot: RobotSession) -> None:
    clock = robot.robot.clock
    clock.sleep(0.5)
    for _ in range(10):
        assert fastest(robot) < REST
        clock.sleep(0.1)


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("leaf", "body", "moving_for"),
    [
        ("NavigateTo", '<NavigateTo goal="0.8;-1.2;3.0"/>', 1.0),
        ("MoveArm", '<MoveArm posture="home"/>', 0.3),
        ("LookAt", '<LookAt point="3.2;1.2;0.7"/>', 0.1),
        ("Grasp", GRASP, 0.5),
    ],
    ids=["NavigateTo", "MoveArm", "LookAt", "Grasp"],
)
def test_a_skill_that_is_halted_in_motion_comes_to_rest(
    at_table: RobotSession, leaf: str, body: str, moving_for: float
) -> None:
    halt_in_motion(at_table, body, leaf, moving_for)
    assert_rests(at_table)


@pytest.mark.slow
def test_a_reactive_parent_that_halts_its_child_stops_the_robot(at_table: RobotSession) -> None:
    body = """<ReactiveSequence>
      <ScriptCondition code="go"/>
      <NavigateTo goal="0.8;-1.2;3.0"/>
    </ReactiveSequence>"""
    tree = at_table.load(tree_of(body))
    tree.blackboard.set("go", True)
    assert tick(tree, 30) == RUNNING
    assert fastest(at_table) > 5 * REST
    tree.blackboard.set("go", False)
    assert tick(tree) != RUNNING
    assert_rests(at_table)
