"""Does the hand still hold what it took? By width and by the wrist camera, each of which can tell alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from bestman_bt.engine import FAILURE, SUCCESS
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.world_model.world_model import HeldObject
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.sensor_pipeline import SensorFault
from tests.behaviours.at_the_table import failures_of, tick, tree_of
from tests.behaviours.truth import known_world, put, succeeds, table_with, why_not

pytestmark = pytest.mark.slow

TAKE = """<Sequence>
  <LookAt surface="table"/>
  <DetectObject object="cup" surface="table"/>
  <PlanGrasp object="cup" grasps="{grasps}"/>
  <Grasp object="cup" grasps="{grasps}"/>
</Sequence>"""
CHECK = '<CheckHeld object="cup" look="{look}" width="{width}" evidence="{evidence}"/>'


@pytest.fixture(scope="module")
def taken(tmp_path_factory) -> Iterator[tuple[RobotSession, GroundTruth, HeldObject]]:
    """A robot that has lifted a cup, and what it believes to hold."""
    config = table_with(tmp_path_factory.mktemp("scene"), cup=("cup", -0.2, 0.0, 0.0))
    with known_world(config) as (session, truth):
        stood = truth.object_pose("cup").position[2]
        assert succeeds(session, TAKE)
        assert truth.object_pose("cup").position[2] > stood + 0.05
        held = session.skills.held
        assert held is not None
        yield session, truth, held


def check(session: RobotSession, look: bool = True) -> tuple[int, str, float]:
    """Status, evidence, width in metres."""
    tree = session.load(tree_of(CHECK))
    tree.blackboard.set("look", look)
    status = tick(tree, 100)
    return status, tree.blackboard.get("evidence"), tree.blackboard.get("width")


def move_fingers(session: RobotSession, width: float) -> None:
    handle = session.skills.gripper.open(width)
    while not handle.done:
        session.robot.clock.sleep(0.05)


def test_the_hand_holds_the_cup_by_width_and_sight(taken) -> None:
    session, truth, held = taken
    pictures: list[object] = []
    session.skills.wrist_camera.subscribe(pictures.append)
    status, evidence, width = check(session)
    assert (status, evidence) == (SUCCESS, "width, sight")
    assert width == pytest.approx(2 * 0.03, abs=0.006)
    assert len(pictures) == 1
    assert session.skills.held is held
    assert truth.touches_robot("cup")


def test_without_a_look_width_alone_is_asked(taken) -> None:
    status, evidence, _ = check(taken[0], look=False)
    assert (status, evidence) == (SUCCESS, "width")


def test_a_robot_without_a_camera_on_its_hand_asks_width_alone(taken, monkeypatch) -> None:
    monkeypatch.setattr(taken[0].skills, "wrist_camera", None)
    status, evidence, _ = check(taken[0])
    assert (status, evidence) == (SUCCESS, "width")


def test_what_the_hand_is_not_believed_to_hold_is_not_checked(taken) -> None:
    assert why_not(taken[0], '<CheckHeld object="can"/>') == ("not_holding", "the hand does not hold the can")


def test_a_lost_object_is_noticed_by_the_width_and_forgotten(taken) -> None:
    """Last of those that need the cup in the hand: someone takes it."""
    session, _, _ = taken
    put(session, "cup", [-6.0, 0.0, -0.1])
    session.robot.clock.sleep(1.0)
    assert check(session)[:2] == (FAILURE, "width")
    code, words = failures_of(session)[0]
    assert code == "object_lost"
    assert words.startswith("the cup is no longer in the hand: it closed to ")
    assert session.skills.held is None


@pytest.mark.parametrize("width", [0.03, 0.055, 0.075])
def test_an_empty_hand_is_noticed_by_sight_where_its_width_is_as_expected(taken, width: float) -> None:
    session, truth, held = taken
    if truth.touches_robot("cup"):
        put(session, "cup", [-6.0, 0.0, -0.1])
    move_fingers(session, width)
    session.skills.held = replace(held, width=session.skills.gripper.width())
    assert check(session, look=False)[0] == SUCCESS
    status, evidence, _ = check(session)
    assert (status, evidence) == (FAILURE, "width, sight")
    code, words = failures_of(session)[0]
    assert code == "object_lost"
    assert "the camera sees through" in words
    assert session.skills.held is None


def test_a_camera_that_delivers_nothing_is_reported_and_the_object_stays_in_the_hand(taken) -> None:
    session, _, held = taken
    session.skills.held = replace(held, width=session.skills.gripper.width())
    camera = session.robot.parts["wrist_camera"]
    camera.fault = SensorFault.BLACK
    assert why_not(session, '<CheckHeld object="cup"/>')[0] == "camera_black"
    camera.fault = None
    assert session.skills.held is not None
