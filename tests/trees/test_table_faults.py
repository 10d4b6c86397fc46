"""What goes wrong at a table: the thing is lost on the way, its place is taken, or nobody can reach there."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from behaviours.pick_and_place import pick_and_place, put_aside, survey
from bestman_bt.configuration.run import load_run
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, Fallback, SubTree
from bestman_bt.messages import Pose
from hal.api import RobotError
from tests.behaviours.at_the_table import PERIOD, failures_of, tick
from tests.behaviours.truth import known_world, table_with

AT_THE_TABLE = (
    "scene.robot_start.x=[0.3, 0.35]",
    "scene.robot_start.y=[-0.1, 0.0]",
    "scene.robot_start.yaw=[0.0, 0.1]",
)
ALONE = tuple(f"scene.objects.{name}.presence=0" for name in ("can", "box", "soup_can"))


def bring_the_cup() -> SubTree:
    return SubTree(pick_and_place, tree_id="PickAndPlace", object="cup", source="table", target="table", goal="{goal}")


@pytest.mark.slow
def test_a_cup_lost_during_transport_is_found_and_delivered(tmp_path) -> None:
    """Someone takes it out of the hand and puts it back onto the table."""
    with known_world(table_with(tmp_path, seed=3, heading=0.0, cup=("cup", -0.2, 0.0, 0.0))) as (session, truth):
        tree = session.load(bring_the_cup())
        goal = truth.object_pose("cup").position + np.array([0.0, 0.25, 0.0])
        tree.blackboard.set("goal", Pose(goal))
        simulation = session.robot.simulation
        cup, engine = simulation.built.objects["cup"], simulation.engine
        stood = engine.body_pose(cup)
        lifted_for, taken = 0, False
        status = RUNNING
        while status == RUNNING and session.robot.clock.now() < 120.0:
            status = tree.tick_once()
            lifted_for += session.skills.held is not None
            if not taken and lifted_for > 5:
                engine.put(cup, *stood)
                taken = True
            tree.sleep(PERIOD)
        assert taken
        assert status == SUCCESS
        told = [(failure.node.split("/")[-1].split("::")[0], failure.error_code) for failure in session.skills.failures]
        assert ("Holding", "object_lost") in told
        assert np.linalg.norm(truth.object_pose("cup").position[:2] - goal[:2]) < 0.02


def look_over_the_table() -> SubTree:
    return SubTree(survey, tree_id="Survey", surface="table")


@pytest.mark.slow
@pytest.mark.parametrize(("make", "holding"), [(bring_the_cup, True), (look_over_the_table, False)])
def test_a_controller_that_is_lost_for_a_while_is_waited_for(
    tmp_path, monkeypatch: pytest.MonkeyPatch, make: Callable[[], SubTree], holding: bool
) -> None:
    """Without waiting, all attempts of the tree would be spent within a second; ``holding``: lost with the cup held."""
    with known_world(table_with(tmp_path, seed=3, heading=0.0, cup=("cup", -0.2, 0.0, 0.0))) as (session, truth):
        tree, robot = session.load(make()), session.robot
        tree.blackboard.set("goal", Pose(truth.object_pose("cup").position + np.array([0.0, 0.25, 0.0])))
        clear, lost, began = robot.clear_stop, [], robot.clock.now()

        def clear_stop() -> None:
            if robot.clock.now() < lost[0] + 8.0:
                raise RobotError("arm_controller: no answer")
            clear()

        monkeypatch.setattr(robot, "clear_stop", clear_stop)
        while (status := tree.tick_once()) == RUNNING:
            under_way = robot.clock.now() > began + 0.5
            if not lost and under_way and (session.skills.held is not None) == holding:
                lost.append(robot.clock.now())
                robot.stop()
            tree.sleep(PERIOD)
        assert status == SUCCESS, session.skills.failures
        assert [failure.error_code for failure in session.skills.failures].count("still_stopped") == 0


@pytest.mark.slow
def test_a_cup_that_cannot_be_placed_is_put_aside_and_the_hand_is_empty(tmp_path) -> None:
    with known_world(table_with(tmp_path, seed=3, heading=0.0, cup=("cup", -0.2, 0.0, 0.0))) as (session, truth):
        aside = SubTree(put_aside, tree_id="PutAside", object="cup", surface="table")
        tree = session.load(Fallback("laid", [bring_the_cup(), aside]))
        tree.blackboard.set("goal", Pose(np.array([3.0, 5.0, 0.8])))
        stood = truth.object_pose("cup").position
        assert tick(tree, 2400) == SUCCESS, session.skills.failures
        cup = truth.object_pose("cup")
        assert "no_stand" in [failure.error_code for failure in session.skills.failures]
        assert session.skills.held is None
        assert abs(cup.position[2] - stood[2]) < 0.002
        assert cup.tilt < np.radians(2.0)


@pytest.mark.parametrize(
    ("goal", "code", "named"),
    [((3.0, 5.0, 0.8), "no_stand", "table"), ((float("nan"), 0.0, 0.8), "bad_input", "goal")],
    ids=["beyond the walls", "not a number"],
)
def test_a_goal_that_nobody_can_reach_is_refused_in_words(goal, code: str, named: str) -> None:
    config = load_run("pick_place_table", seed=3, settings=[*AT_THE_TABLE, *ALONE])
    with known_world(config) as (session, _):
        body = '<FindStandPose surface="table" goal="{goal}" stand="{stand}"/>'
        tree = session.load(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
        tree.blackboard.set("goal", Pose(np.array(goal)))
        status = RUNNING
        while status == RUNNING:
            status = tree.tick_once()
            tree.sleep(PERIOD)
        assert status == FAILURE
        told, words = failures_of(session)[0]
        assert told == code
        assert named in words


def test_a_goal_that_is_taken_is_refused_in_words() -> None:
    config = load_run("pick_place_table", seed=3, settings=[*AT_THE_TABLE, *ALONE])
    with known_world(config) as (session, truth):
        body = """<Sequence><LookAt surface="table" point="{goal}"/>
          <FindPlacePose object="cup" surface="table" goal="{goal}" pose="{pose}"/></Sequence>"""
        tree = session.load(f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>')
        cup = truth.object_pose("cup")
        tree.blackboard.set("goal", Pose(cup.position + np.array([0.0, 0.03, 0.0])))
        status = RUNNING
        while status == RUNNING:
            status = tree.tick_once()
            tree.sleep(PERIOD)
        assert status == FAILURE
        code, words = failures_of(session)[0]
        assert code == "goal_taken"
        assert words.endswith("of the 12 cm disc at the goal is taken")
