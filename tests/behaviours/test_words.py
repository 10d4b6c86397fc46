"""Skills and conditions that cannot do what they are asked say why, in words, and name what there is."""

from __future__ import annotations

import pytest

from bestman_bt.engine import FAILURE
from bestman_bt.runtime.resolved_config import load_for
from bestman_bt.runtime.robot_session import RobotSession
from tests.behaviours.at_the_table import failures_of, tick, tree_of


@pytest.mark.parametrize(
    ("body", "code", "why"),
    [
        ('<MoveArm posture="salute"/>', "unknown_posture", "no posture 'salute'; it has carry, carry_beside,"),
        ('<LookAt surface="shelf"/>', "unknown_surface", "no surface 'shelf' in the map; known: table/top"),
        ('<LookAt object="cup"/>', "no_target", "nothing to look at"),
        ('<LookAt point="0.4;5;1"/>', "unreachable", "head cannot look at"),
        ('<EstimatePose object="cup"/>', "not_found", "the cup has not been seen; detect it first"),
        ('<PlanGrasp object="cup" grasps="{g}"/>', "not_found", "detect it first"),
        ('<PlaceOn object="cup" pose="0;0;0"/>', "not_holding", "the hand does not hold the cup"),
        ('<Release object="cup"/>', "not_holding", "the hand does not hold the cup"),
        ('<NavigateTo goal="9;9;0"/>', "goal_outside", "the goal (9.00, 9.00) m is not on the map"),
        ('<NavigateTo goal="2.25;-0.42;0"/>', "goal_blocked", "the base would touch an obstacle at the goal"),
        ('<FindStandPose surface="shelf" stand="{s}"/>', "unknown_surface", "no surface 'shelf' in the map"),
        ('<Holding object="cup"/>', "not_holding", "the hand does not hold the cup"),
        ('<Reachable object="cup"/>', "not_found", "the cup has not been seen"),
        ('<ObjectVisible object="cup"/>', "not_visible", "the cup has not been seen"),
        ('<ObjectAt object="cup" goal="0;0;0"/>', "not_at_goal", "the cup has not been seen"),
        ('<At goal="0;0;0"/>', "not_at_goal", "m and "),
        (
            '<DetectObject object="spoon" surface="table"/>',
            "unknown_object",
            "no detection has this label; models: box, can",
        ),
    ],
    ids=lambda value: value if value.startswith("<") else "",
)
def test_what_cannot_be_done_fails_in_words(bystander: RobotSession, body: str, code: str, why: str) -> None:
    before = len(bystander.skills.failures)
    # As a tree whose names come from elsewhere: those that stand in it are checked when it is loaded.
    tree = load_for(bystander.setup, tree_of(body), context=bystander.skills, clock=bystander.robot.clock)
    assert tick(tree, 100) == FAILURE
    assert len(bystander.skills.failures) == before + 1
    ((told, words),) = failures_of(bystander)
    assert told == code
    assert why in words
