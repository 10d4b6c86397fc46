"""An object that slips out of the hand on the way: it is noticed at once, told, forgotten, and the robot stops."""

from __future__ import annotations

import pytest

from bestman_bt.engine import FAILURE, RUNNING
from bestman_bt.runtime.robot_session import RobotSession
from tests.behaviours.at_the_table import failures_of, fastest, tick, tree_of
from tests.behaviours.truth import known_world, succeeds, table_with

pytestmark = pytest.mark.slow

TAKE = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="cup" surface="table"/>
  <PlanGrasp object="cup" grasps="{grasps}"/>
  <Grasp object="cup" grasps="{grasps}"/>
  <Retreat posture="carry"/>
</Sequence>"""
CARRY = """<ReactiveSequence>
  <Holding object="cup"/>
  <NavigateTo goal="1.2;-0.6;3.0"/>
</ReactiveSequence>"""


def grease(session: RobotSession, name: str) -> None:
    """From now on nothing holds the thing by friction."""
    simulation = session.robot.simulation
    simulation.engine.set_friction(simulation.built.objects[name], 0.0, 0.0)


def test_a_cup_that_slips_out_of_the_hand_mid_way_stops_the_robot_which_reports_it(tmp_path) -> None:
    with known_world(table_with(tmp_path, heading=0.0, cup=("cup", -0.2, 0.0, 0.0))) as (session, truth):
        assert succeeds(session, TAKE), session.skills.failures
        tree = session.load(tree_of(CARRY))
        for _ in range(40):
            assert tick(tree) == RUNNING, session.skills.failures
        assert fastest(session) > 0.1
        carried = truth.object_pose("cup").position[2]
        grease(session, "cup")
        slipped = session.skills.clock.now()
        assert tick(tree, 60) == FAILURE
        assert session.skills.clock.now() - slipped < 1.5
        ((code, words),) = failures_of(session)
        assert code == "object_lost"
        assert words.startswith("the cup is no longer in the hand: it closed to ")
        assert session.skills.held is None
        session.robot.clock.sleep(0.6)
        assert fastest(session) < 0.02
        assert truth.object_pose("cup").position[2] < carried - 0.1
        assert session.skills.gripper.width() == pytest.approx(0.0, abs=0.01)
