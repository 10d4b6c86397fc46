"""Doors and drawers that are opened by other means than a hand: each is caught, by the call and by what it does."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.engine import Tree
from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.evaluation.episode import run_episode
from bestman_bt.extras import PYBULLET_HAS_WHEELS
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.scene import World
from hal.api import Robot
from hal.pybullet.client import UNGUARDED_FUNCTIONS
from hal.pybullet.package import pybullet
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.door_watcher import DoorWatcher, WatchedArticulation
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.guards import ReadPurpose

if not PYBULLET_HAS_WHEELS:
    pytest.skip("its cheats are calls of PyBullet, which has no wheels for this Python", allow_module_level=True)

# As a plug-in takes them: before any robot connects.
getBasePositionAndOrientation = pybullet.getBasePositionAndOrientation
resetJointState, setJointMotorControl2 = pybullet.resetJointState, pybullet.setJointMotorControl2

DOOR = "fridge/upper_door"
STEP = 1 / 240


@pytest.fixture(scope="module")
def world() -> World:
    return draw_world(load_scene("fridge_room"), 3)


@pytest.fixture
def robot(world: World) -> Iterator[PyBulletRobot]:
    with PyBulletRobot(load_robot_model("diff_panda"), world) as robot:
        robot.clock.sleep(STEP)
        yield robot


@pytest.fixture
def door(robot: PyBulletRobot) -> tuple[int, int]:
    return robot.simulation.built.articulations[DOOR]


@pytest.fixture
def hidden(robot: PyBulletRobot) -> Callable[[str], Callable[..., Any]]:
    """Functions as a cheat has them who took them before the simulation was imported: only effects are seen."""
    return lambda name: partial(UNGUARDED_FUNCTIONS[name], physicsClientId=robot.client.id)


def judged(robot: PyBulletRobot, seconds: float = 0.1) -> Audit:
    robot.clock.sleep(seconds)
    return audit(robot.audit_record())


def says(verdict: Audit, words: str) -> bool:
    return any(DOOR in finding and words in finding for finding in verdict.findings)


def test_doors_that_nobody_touches_are_not_accused(robot) -> None:
    verdict = judged(robot)
    assert verdict.honest
    assert verdict.findings == ()


def test_a_door_that_is_reset_open_is_seen(robot, door, hidden) -> None:
    hidden("resetJointState")(*door, 1.5)
    verdict = judged(robot)
    assert verdict.teleports == 1
    assert says(verdict, "without a velocity")


def test_a_reset_that_was_taken_from_the_module_early_is_counted(robot, door) -> None:
    resetJointState(*door, 1.5, physicsClientId=robot.client.id)
    assert robot.simulation.ledger.counts["resets"] == 1


def test_a_door_that_creeps_open_is_seen(robot, door, hidden) -> None:
    for count in range(24):
        hidden("resetJointState")(*door, 5e-6 * (count + 1))
        robot.clock.sleep(STEP)
    assert judged(robot).teleports >= 1


@pytest.mark.parametrize("force", [500.0, 6.0], ids=["strong", "no stronger than the friction"])
def test_a_motor_on_the_hinge_is_seen(robot, door, hidden, force) -> None:
    hidden("setJointMotorControl2")(*door, pybullet.VELOCITY_CONTROL, targetVelocity=1.0, force=force)
    verdict = judged(robot)
    assert robot.simulation.ledger.counts["tampering"] == 0
    assert verdict.tampering >= 1
    assert says(verdict, "driven")


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize(("effort", "is_driven"), [(2.04, False), (2.06, True)])
def test_a_joint_that_exerts_more_than_its_friction_is_driven_either_way(sense, effort, is_driven) -> None:
    watcher = object.__new__(DoorWatcher)
    watched = WatchedArticulation(
        DOOR, 0, 0, 1.5, friction=2.0, latched=2.0, travel=0.0, falling=0.0, position=0.7, velocity=0.0
    )
    assert ("is driven by its joint" in watcher.motor_fault(watched, 0.0, sense * effort)) == is_driven


def test_a_motor_that_was_taken_from_the_module_early_is_counted(robot, door) -> None:
    server = robot.client.id
    setJointMotorControl2(*door, pybullet.VELOCITY_CONTROL, targetVelocity=1.0, force=500, physicsClientId=server)
    assert robot.simulation.ledger.counts["tampering"] == 1


def test_what_the_wrapper_hands_out_during_a_run_is_counted(robot, door) -> None:
    engine = robot.simulation.actor()
    engine.put(door[0], (1.5, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    engine.body_pose(door[0])
    assert robot.simulation.ledger.counts == {"resets": 1, "truth_reads": 1}
    assert judged(robot).teleports >= 1


def test_a_motor_among_the_effort_controls_is_seen(robot, door, hidden) -> None:
    motor = hidden("setJointMotorControl2")
    robot.simulation.effort_controls.append(
        lambda: motor(*door, pybullet.VELOCITY_CONTROL, targetVelocity=1.0, force=500.0)
    )
    assert judged(robot).tampering >= 1


@pytest.mark.parametrize("steps", [1, 24])
def test_a_torque_that_nothing_exerts_is_seen(robot, door, hidden, steps) -> None:
    for _ in range(steps):
        hidden("setJointMotorControl2")(*door, pybullet.TORQUE_CONTROL, force=30.0)
        robot.clock.sleep(STEP)
    assert says(judged(robot), "nothing pressed on it")


@pytest.mark.parametrize("friction", [0.0, 3.0], ids=["oiled", "half as stiff"])
def test_a_hinge_without_its_friction_is_seen(robot, door, hidden, friction) -> None:
    """A door that got a push (seen as well) slides against less than its model's friction."""
    hidden("setJointMotorControl2")(*door, pybullet.VELOCITY_CONTROL, targetVelocity=0.0, force=friction)
    hidden("resetJointState")(*door, 0.1, 0.5)
    robot.clock.sleep(STEP)
    assert says(judged(robot), f"slides against {friction:.2f}")


def test_a_heavy_flap_may_fall_by_its_weight(world) -> None:
    """A door whose hinge lies: nothing presses on it, and it gains speed."""
    fridge = next(piece for piece in world.furniture if piece.name == "fridge")
    lying = tuple(
        dataclasses.replace(watched, axis=(1.0, 0.0, 0.0), friction=0.1, mass=20.0)
        for watched in fridge.model.articulations
    )
    ajar = {watched.name: 0.3 for watched in lying}
    piece = dataclasses.replace(fridge, model=dataclasses.replace(fridge.model, articulations=lying), open=ajar)
    with PyBulletRobot(load_robot_model("diff_panda"), dataclasses.replace(world, furniture=(piece,))) as robot:
        truth = GroundTruth(robot)
        verdict = judged(robot, 0.3)
        assert abs(truth.articulation_position(DOOR) - 0.3) > 0.05
        assert verdict.tampering == 0


def test_a_monitor_that_is_kept_from_the_steps_is_noticed(robot) -> None:
    robot.simulation.step_observers.clear()
    assert judged(robot).tampering > 0


def test_a_read_that_was_taken_from_the_module_early_is_counted(robot, door) -> None:
    getBasePositionAndOrientation(door[0], physicsClientId=robot.client.id)
    assert judged(robot).ground_truth_reads == 1


def test_the_truth_is_closed_as_soon_as_those_who_evaluate_have_it(world) -> None:
    """Before the first step: what leaves do while their tree is loaded is counted."""
    with PyBulletRobot(load_robot_model("diff_panda"), world) as robot:
        early = GroundTruth(robot)
        robot.close_truth()
        late = robot.simulation.reader(ReadPurpose.SENSOR)
        assert early.trusted
        assert not late.trusted
        early.articulation_position(DOOR)
        assert robot.simulation.ledger.counts["truth_reads"] == 0
        late.body_pose(robot.simulation.built.furniture["fridge"])
        assert robot.simulation.ledger.counts["truth_reads"] == 1


def test_a_judged_run_closes_the_truth_before_its_first_tick(tmp_path: Path) -> None:
    """Time has not run yet when ``watch`` is called, as it has not when leaves are loaded."""
    views: list[GroundTruth] = []

    def prepare_robot(robot: Robot) -> None:
        assert isinstance(robot, PyBulletRobot)
        views.append(GroundTruth(robot))

    def watch(session: RobotSession, tree: Tree) -> Callable[[], None]:
        assert isinstance(session.robot, PyBulletRobot)
        views.append(GroundTruth(session.robot))
        return lambda: None

    tree = tmp_path / "nothing.xml"
    tree.write_text('<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>')
    config = load_run(tree=str(tree), scene="fridge_room", robot="diff_panda", seed=3)
    run_episode(config, watch=watch, prepare_robot=prepare_robot)
    assert [view.trusted for view in views] == [True, False]
