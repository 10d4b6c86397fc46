"""Somebody disturbs with a run: it is told, is no fault of the run, and is no cloak for cheats."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.evaluation.audit import Audit, audit
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.scene import PlacedFurniture, World
from hal.api import MobileBase
from hal.simulation.disturbance_injector import DisturbanceInjector
from hal.simulation.engine import Engine
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from tests.default_engine import DefaultRobot

DRAWER, OTHER = "drawer_chest/drawer_3", "drawer_chest/drawer_1"
OPEN = 0.28
BESIDE = (0.05, 0.25, 0.0)
ALLOWED = [("fingers", "can"), ("can", "table")]


def chest_world(gap: float, *opened: str) -> World:
    """A chest with drawers open by ``OPEN``; the base stands so many metres before them, or reaches so far below."""
    world = draw_world(load_scene("chest_room"), 1)
    (chest,) = world.furniture
    chest = replace(chest, open={name.partition("/")[2]: OPEN for name in opened})
    return replace(world, furniture=(chest,), robot_start=before(chest, gap))


def before(chest: PlacedFurniture, gap: float) -> Pose2D:
    reach = 0.36  # from the middle of the base to its front
    return chest.actual @ Pose2D(-chest.model.footprint[0] / 2 - OPEN - gap - reach, 0.0, 0.0)


def told(judged: Audit) -> list[str]:
    return [text.partition(": ")[2] for text in judged.disturbances]


def _hidden(robot: SimulatedRobot) -> Engine:
    """The engine past what counts its calls."""
    return robot.simulation._engine


def _friction(robot: SimulatedRobot) -> float:
    can = robot.simulation.built.objects["can"]
    return _hidden(robot).friction(can)[0]


@pytest.fixture(scope="module")
def slip(robot_model, table_worlds, operator) -> Iterator[tuple[dict[str, float], Audit]]:
    """A can is lifted by 10 cm and slips; heights over the table, friction, and what the audit says."""
    with DefaultRobot(robot_model, table_worlds["can"], seed=3) as robot:
        hand, somebody = operator(robot), DisturbanceInjector(robot)
        friction = _friction(robot)
        stood = hand.truth.object_pose("can").position[2]
        seen = {"slips untouched": float(somebody.let_slip("can") is not None)}
        hand.grasp("can")
        elsewhere = Pose(np.array([0.65, 0.3, stood]), np.array([0.0, 0.0, 0.0, 1.0]))
        seen["moved from the hand"] = float(somebody.move_object("can", elsewhere, "table/top") is not None)
        hand.move_vertically(0.1)
        seen["lifted"] = hand.truth.object_pose("can").position[2] - stood
        event = somebody.let_slip("can")
        seen["slips held"] = float(event is not None)
        robot.clock.sleep(1.0)
        seen["fallen"] = hand.truth.object_pose("can").position[2] - stood
        now = _friction(robot)
        seen["friction lost"] = friction - now
        yield seen, audit(robot.audit_record(), ALLOWED, [event])


@pytest.mark.slow
def test_what_is_held_slips_out_of_the_hand_and_is_as_it_was_then(slip: tuple[dict[str, float], Audit]) -> None:
    seen, judged = slip
    assert seen["slips held"]
    assert seen["lifted"] > 0.09
    assert seen["fallen"] < 0.01
    assert seen["friction lost"] == 0.0
    assert judged.honest, judged.findings
    assert judged.faults(0.002) == ()
    assert told(judged) == ["the can slips in the hand", "the can is out of the hand"]


def test_nothing_slips_that_no_hand_holds_and_nobody_takes_it_out_of_the_hand(
    slip: tuple[dict[str, float], Audit],
) -> None:
    seen, _ = slip
    assert not seen["slips untouched"]
    assert not seen["moved from the hand"]


@pytest.mark.slow
def test_somebody_puts_a_can_elsewhere_and_nothing_counts_as_teleported(robot_model, table_worlds) -> None:
    with DefaultRobot(robot_model, table_worlds["can"], seed=3) as robot:
        truth, somebody = GroundTruth(robot), DisturbanceInjector(robot)
        robot.clock.sleep(3.0)  # it sleeps
        place = Pose(truth.object_pose("can").position + np.array(BESIDE))
        event = somebody.move_object("can", place, "table/top")
        robot.clock.sleep(1.0)
        assert np.linalg.norm(truth.object_pose("can").position - place.position) < 0.002
        assert truth.supports("can") == ("table",)
        within = Pose(place.position - np.array((0.0, 0.0, 0.05)))
        assert not somebody.move_object("can", within, "the table's board")
        robot.clock.sleep(0.5)
        assert np.linalg.norm(truth.object_pose("can").position - place.position) < 0.002
        judged = audit(robot.audit_record(), script=[event])
        assert judged.honest, judged.findings
        assert told(judged) == ["a person moves the can by 0.25 m, on table/top"]


def test_a_teleport_right_after_somebody_moved_it_is_still_seen(robot_model, table_worlds) -> None:
    with DefaultRobot(robot_model, table_worlds["can"], seed=3) as robot:
        truth, somebody = GroundTruth(robot), DisturbanceInjector(robot)
        place = Pose(truth.object_pose("can").position + np.array(BESIDE))
        assert somebody.move_object("can", place, "table/top")
        robot.clock.sleep(0.1)
        body = robot.simulation.built.objects["can"]
        back = (place.position - np.array((0.0, 0.1, 0.0))).tolist()
        _hidden(robot).put(body, back, [0.0, 0.0, 0.0, 1.0])
        robot.clock.sleep(0.1)
        assert audit(robot.audit_record()).teleports == 1


def test_an_injector_created_late_is_a_violation_under_any_name(robot_model, table_worlds, operator) -> None:
    with DefaultRobot(robot_model, table_worlds["can"], seed=3) as robot:
        place = Pose(GroundTruth(robot).object_pose("can").position + np.array(BESIDE))
        robot.clock.sleep(0.1)
        assert DisturbanceInjector(robot).move_object("can", place, "table/top")
        robot.clock.sleep(0.1)
        judged = audit(robot.audit_record())
        assert judged.teleports >= 1
        assert judged.ground_truth_reads >= 1
        assert any("can jumped" in finding for finding in judged.findings)
        assert judged.disturbances == ()


@pytest.fixture(scope="module")
def shut(robot_model) -> Iterator[tuple[list[float], Audit]]:
    """Somebody pushes a drawer shut before the robot: how far it was open, every 0.1 s, and what the audit says."""
    with DefaultRobot(robot_model, chest_world(0.3, DRAWER)) as robot:
        truth, somebody = GroundTruth(robot), DisturbanceInjector(robot)
        event = somebody.push_shut(DRAWER, 0.3)
        assert not somebody.push_shut(DRAWER, 0.3)  # with one hand
        seen = []
        for _ in range(15):
            robot.clock.sleep(0.1)
            seen.append(truth.articulation_position(DRAWER))
        yield seen, audit(robot.audit_record(), script=[event])


@pytest.mark.slow
def test_a_drawer_is_pushed_shut_at_the_speed_of_a_hand(shut: tuple[list[float], Audit]) -> None:
    seen, judged = shut
    assert seen[4] == pytest.approx(OPEN - 0.5 * 0.3, abs=0.02)
    assert seen[-1] < 0.005
    assert judged.honest, judged.findings
    assert told(judged) == [f"a person pushes {DRAWER} shut", f"a person has shut {DRAWER}"]


def test_nobody_pushes_a_drawer_that_the_robot_stands_at(robot_model) -> None:
    with DefaultRobot(robot_model, chest_world(-0.05, DRAWER)) as robot:
        truth, somebody = GroundTruth(robot), DisturbanceInjector(robot)
        assert not somebody.push_shut(DRAWER, 0.3)
        robot.clock.sleep(0.3)
        assert truth.articulation_position(DRAWER) == pytest.approx(OPEN, abs=1e-3)


@pytest.mark.slow
def test_the_hand_waits_while_the_robot_comes_near(robot_model) -> None:
    with DefaultRobot(robot_model, chest_world(0.2, DRAWER)) as robot:
        truth, somebody, base = GroundTruth(robot), DisturbanceInjector(robot), robot.part("base", MobileBase)
        event = somebody.push_shut(DRAWER, 0.02)
        for _ in range(12):
            base.set_velocity(0.3, 0.0, 0.0)
            robot.clock.sleep(0.05)
        robot.clock.sleep(0.5)
        waits = truth.articulation_position(DRAWER)
        robot.clock.sleep(1.0)
        assert truth.articulation_position(DRAWER) == pytest.approx(waits, abs=1e-4)
        assert 0.1 < waits < OPEN - 0.005
        judged = audit(robot.audit_record(), script=[event])
        assert judged.honest, judged.findings
        assert judged.faults(0.002) == ()


def test_a_drawer_that_moves_by_itself_while_another_is_pushed_is_seen(robot_model) -> None:
    with DefaultRobot(robot_model, chest_world(0.3, DRAWER, OTHER)) as robot:
        somebody = DisturbanceInjector(robot)
        event = somebody.push_shut(DRAWER, 0.3)
        robot.clock.sleep(0.1)
        body, joint = robot.simulation.built.articulations[OTHER]
        _hidden(robot).turn(body, [joint], [-0.3], [40.0])
        robot.clock.sleep(0.3)
        judged = audit(robot.audit_record(), script=[event])
        assert judged.tampering >= 1
        assert any(OTHER in finding for finding in judged.findings)
        assert not any(DRAWER in finding for finding in judged.findings)
