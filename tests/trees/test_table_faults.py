"""What goes wrong at a table: the thing is lost on the way, its place is taken, or nobody can reach there."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.configuration import load_run
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import Pose
from tests.behaviours.at_the_table import PERIOD, failures_of
from tests.behaviours.truth import known_world

AT_THE_TABLE = (
    "scene.robot_start.x=[0.3, 0.35]",
    "scene.robot_start.y=[-0.1, 0.0]",
    "scene.robot_start.yaw=[0.0, 0.1]",
)
ALONE = tuple(f"scene.objects.{name}.presence=0" for name in ("can", "box", "soup_can"))


def test_a_cup_that_is_lost_on_the_way_is_found_and_brought_all_the_same() -> None:
    """Someone takes it out of the hand and puts it back onto the table."""
    config = load_run("pick_place_table", seed=3, settings=[*AT_THE_TABLE, *ALONE])
    with known_world(config) as (session, truth):
        tree = session.load()
        simulation = session.robot.simulation
        cup, client = simulation.built.objects["cup"], simulation.client
        stood = client.getBasePositionAndOrientation(cup)
        lifted_for, taken = 0, False
        status = RUNNING
        while status == RUNNING and session.robot.clock.now() < 200.0:
            status = tree.tick_once()
            lifted_for += session.skills.world.held is not None
            if not taken and lifted_for > 60:
                client.resetBasePositionAndOrientation(cup, *stood)
                taken = True
            tree.sleep(PERIOD)
        assert taken
        assert status == SUCCESS
        told = [(failure.node.split("/")[-1].split("::")[0], failure.error_code) for failure in session.skills.failures]
        assert any(code in ("object_lost", "not_holding") for node, code in told if node in ("Holding", "PlaceOn"))
        (goal,) = session.setup.goals
        assert np.linalg.norm(truth.object_pose("cup").position[:2] - goal.pose.position[:2]) < 0.02


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
