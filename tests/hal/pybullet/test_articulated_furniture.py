"""Doors and drawers in physics: they stay as they are left and open when they are pulled by their handles."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np
import pytest

from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.scene import LATCH_TRAVEL, Articulation, PlacedFurniture, PlacedObject, World
from hal.pybullet.package import pybullet
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.bodies import SimulationError
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.joint_motors import mass_distribution
from hal.simulation.scene_recorder import SceneRecorder

PLACES = {
    "drawer_chest": Pose2D(1.8, 1.2, 0.3),
    "fridge": Pose2D(1.8, -1.5, -0.2),
    "cupboard": Pose2D(-1.8, 1.2, 2.5),
    "microwave": Pose2D(1.8, 0.0, 0.0),
    "dishwasher": Pose2D(-1.8, -1.4, 3.0),
    "room_door": Pose2D(0.0, 2.2, 1.2),
}
LEAVES = [f"{name}/{a.name}" for name in PLACES for a in read_furniture(name).articulations]
DOORS = [name for name in LEAVES if "drawer" not in name]
QUICK = ("drawer_chest/drawer_3", "dishwasher/door", "room_door/door")
"""One that slides, one hinged below and one at its side."""


def _the_others_slow(names: list[str], quick: Collection[str] = QUICK) -> list[Any]:
    return [name if name in quick else pytest.param(name, marks=pytest.mark.slow) for name in names]


@pytest.fixture(scope="module")
def world(empty_world: World) -> World:
    table = read_furniture("table")
    pieces = [PlacedFurniture(name, read_furniture(name), at, at) for name, at in PLACES.items()]
    pieces = [dataclasses.replace(p, elevation=0.75, on="table") if p.name == "microwave" else p for p in pieces]
    pieces.append(PlacedFurniture("table", table, PLACES["microwave"], PLACES["microwave"]))
    return dataclasses.replace(empty_world, furniture=tuple(pieces))


@pytest.fixture(scope="module")
def robot(robot_model: RobotModel, world: World) -> Iterator[PyBulletRobot]:
    with PyBulletRobot(robot_model, world) as robot:
        yield robot


@pytest.fixture(scope="module")
def truth(robot: PyBulletRobot) -> GroundTruth:
    return GroundTruth(robot)


def joint(world: World, name: str) -> Articulation:
    piece, _, part = name.partition("/")
    model = next(p.model for p in world.furniture if p.name == piece)
    return next(a for a in model.articulations if a.name == part)


def pull(robot: PyBulletRobot, articulation: Articulation, name: str, share: float, seconds: float) -> None:
    """Pull at the handle, in the direction in which it opens, with a share of what overcomes friction and latch."""
    simulation = robot.simulation
    body, link = simulation.built.articulations[name]
    server = simulation.engine.client.id
    from_articulation = Pose(-np.array(articulation.origin)) @ articulation.handle.pose
    lever = 1.0
    if articulation.kind == "revolute":
        lever = float(np.linalg.norm(articulation.handle.pose.position - articulation.handle.hinge))
        along = (articulation.handle.pose.position - articulation.handle.hinge) @ np.array(articulation.axis)
        lever = float(np.sqrt(lever**2 - along**2))
    for _ in range(round(seconds * 240)):
        state = pybullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=server)
        map_from_articulation = Pose(np.array(state[4]), np.array(state[5]))
        hold = articulation.friction + articulation.latch
        force = share * hold / lever * (map_from_articulation.rotation @ articulation.handle.opening_direction)
        point = (map_from_articulation @ from_articulation).position
        pybullet.applyExternalForce(
            body, link, force.tolist(), point.tolist(), pybullet.WORLD_FRAME, physicsClientId=server
        )
        robot.clock.sleep(1 / 240)


@pytest.mark.slow
def test_what_stands_open_at_the_start_stays_so_without_a_reset_on_record(
    robot_model: RobotModel, world: World
) -> None:
    opened = {"drawer_chest": {"drawer_2": 0.2}, "fridge": {"upper_door": 1.3}, "dishwasher": {"door": 1.0}}
    pieces = tuple(dataclasses.replace(p, open=opened.get(p.name, {})) for p in world.furniture)
    with PyBulletRobot(robot_model, dataclasses.replace(world, furniture=pieces)) as robot:
        truth = GroundTruth(robot)
        robot.clock.sleep(1.0)
        for name in LEAVES:
            piece, _, part = name.partition("/")
            assert truth.articulation_position(name) == pytest.approx(opened.get(piece, {}).get(part, 0.0), abs=2e-3)
        assert robot.simulation.ledger.counts["resets"] == 0


def test_a_piece_may_be_named_like_its_door(robot_model: RobotModel, empty_world: World) -> None:
    at = Pose2D(0.0, 2.2, 1.2)
    door = PlacedFurniture("door", read_furniture("room_door"), at, at, open={"door": 0.5})
    with PyBulletRobot(robot_model, dataclasses.replace(empty_world, furniture=(door,))) as robot:
        assert GroundTruth(robot).articulation_names == ("door/door",)
        assert GroundTruth(robot).articulation_position("door/door") == pytest.approx(0.5, abs=2e-3)


@pytest.mark.slow
def test_all_stays_closed_while_nobody_pulls(robot: PyBulletRobot, truth: GroundTruth) -> None:
    assert set(truth.articulation_names) == set(LEAVES)
    robot.clock.sleep(2.0)
    assert max(abs(truth.articulation_position(name)) for name in LEAVES) < 1e-4
    body, _ = robot.simulation.built.articulations["fridge/upper_door"]
    assert not pybullet.getContactPoints(bodyA=body, physicsClientId=robot.client.id)


@pytest.mark.slow
@pytest.mark.parametrize("name", _the_others_slow(LEAVES))
def test_a_pull_at_the_handle_opens_it_once_it_exceeds_the_friction(
    robot: PyBulletRobot, truth: GroundTruth, world: World, name: str
) -> None:
    articulation = joint(world, name)
    pull(robot, articulation, name, share=0.7, seconds=0.3)
    assert abs(truth.articulation_position(name)) < 1e-3
    pull(robot, articulation, name, share=1.8, seconds=0.8)
    opened = truth.articulation_position(name)
    assert opened > 0.1 * articulation.upper
    assert opened < articulation.upper + 0.01
    robot.clock.sleep(2.0)
    left = truth.articulation_position(name)
    robot.clock.sleep(0.5)
    assert truth.articulation_position(name) == pytest.approx(left, abs=1e-3)  # it stays where it is let go


@pytest.mark.parametrize("name", _the_others_slow(DOORS, ["room_door/door"]))
@pytest.mark.parametrize(("friction", "opens"), [(None, False), (1.5, True)])
def test_an_open_hand_that_pushes_the_handle_sideways_opens_no_door(
    robot_model: RobotModel, world: World, name: str, friction: float | None, opens: bool
) -> None:
    """60 N towards or away from the hinge; a hinge of 1.5 N m would give way where the handle stands off."""
    piece = name.partition("/")[0]
    placed = next(p for p in world.furniture if p.name == piece)
    if friction is not None:
        weak = tuple(dataclasses.replace(a, friction=friction, latch=0.0) for a in placed.model.articulations)
        placed = dataclasses.replace(placed, model=dataclasses.replace(placed.model, articulations=weak))
    if opens and placed.model.articulations[0].handle.kind == "edge":
        pytest.skip("a lip has no standoff that a push could turn about")
    alone = dataclasses.replace(world, furniture=(placed,))
    furthest = 0.0
    for sign in (-1.0, 1.0):
        with PyBulletRobot(robot_model, alone) as robot:
            truth = GroundTruth(robot)
            push_sideways(robot, joint(alone, name), name, 60.0 * sign, 0.5)
            furthest = max(furthest, truth.articulation_position(name))
    assert (furthest > 0.05) is opens


def push_sideways(robot: PyBulletRobot, articulation: Articulation, name: str, force: float, seconds: float) -> None:
    """Push at the handle along its front, across the hinge."""
    simulation, handle = robot.simulation, articulation.handle
    body, link = simulation.built.articulations[name]
    across = np.cross(handle.outward, np.array(articulation.axis))
    from_articulation = Pose(-np.array(articulation.origin)) @ handle.pose
    for _ in range(round(seconds * 240)):
        state = pybullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=robot.client.id)
        map_from_articulation = Pose(np.array(state[4]), np.array(state[5]))
        pybullet.applyExternalForce(
            body,
            link,
            (force * map_from_articulation.rotation @ across).tolist(),
            (map_from_articulation @ from_articulation).position.tolist(),
            pybullet.WORLD_FRAME,
            physicsClientId=robot.client.id,
        )
        robot.clock.sleep(1 / 240)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", ["dishwasher/door", "room_door/door"])
def test_a_latch_takes_a_harder_first_pull_and_nothing_afterwards(
    robot_model: RobotModel, world: World, name: str
) -> None:
    articulation = joint(world, name)
    assert articulation.latch > 0.0
    held, free = articulation.friction + articulation.latch, articulation.friction
    with PyBulletRobot(robot_model, world) as robot:
        truth = GroundTruth(robot)
        pull(robot, articulation, name, share=0.85, seconds=0.3)  # more than the friction alone
        assert 0.85 * held > 1.05 * free
        assert abs(truth.articulation_position(name)) < 1e-3
        pull(robot, articulation, name, share=1.5, seconds=0.3)
        opened = truth.articulation_position(name)
        assert opened > LATCH_TRAVEL["revolute"]
        pull(robot, articulation, name, share=min(0.85, 1.3 * free / held), seconds=0.3)
        assert truth.articulation_position(name) > opened + 0.05
        assert "setJointMotorControl2" not in robot.simulation.ledger.calls


@pytest.mark.slow
def test_a_recording_sees_the_door_turn(robot_model: RobotModel, world: World) -> None:
    with PyBulletRobot(robot_model, world) as robot:
        recorder, truth = SceneRecorder(robot), GroundTruth(robot)
        before = recorder.scene_snapshot().articulation_poses["microwave/door"]
        pull(robot, joint(world, "microwave/door"), "microwave/door", share=2.0, seconds=0.6)
        after = recorder.scene_snapshot().articulation_poses["microwave/door"]
        np.testing.assert_allclose(after.position, before.position, atol=1e-6)
        turned = before.yaw - after.yaw  # hinged at the left, it turns about -z
        assert turned == pytest.approx(truth.articulation_position("microwave/door"), abs=1e-4)
        assert turned > 0.1


@pytest.mark.slow
def test_what_lies_in_a_drawer_comes_along(robot_model: RobotModel, world: World) -> None:
    chest = next(p for p in world.furniture if p.name == "drawer_chest")
    drawer = joint(world, "drawer_chest/drawer_3")
    ball = ObjectModel("puck", (0.8, 0.2, 0.2), 0.1, 0.8, (PlacedShape(Cylinder(0.02, 0.03), Pose()),))
    inside = chest.pose @ Pose.from_xyz_rpy((0.0, 0.0, drawer.handle.panel.position[2] - 0.05))
    held = dataclasses.replace(world, objects=(PlacedObject("puck", ball, inside),))
    with PyBulletRobot(robot_model, held) as robot:
        truth = GroundTruth(robot)
        robot.clock.sleep(0.5)
        start = truth.object_pose("puck").position
        assert truth.supports("puck") == ("drawer_chest",)
        pull(robot, drawer, "drawer_chest/drawer_3", share=1.5, seconds=0.6)
        robot.clock.sleep(0.5)
        moved = truth.object_pose("puck").position - start
        outwards = chest.pose.rotation @ np.array([-1.0, 0.0, 0.0])
        assert moved @ outwards == pytest.approx(truth.articulation_position("drawer_chest/drawer_3"), abs=0.03)
        assert moved @ outwards > 0.04


def test_the_truth_names_the_doors_that_there_are(truth: GroundTruth) -> None:
    with pytest.raises(SimulationError, match=r"there is no door or drawer 'fridge/door'; there is drawer_chest/"):
        truth.articulation_position("fridge/door")


def test_a_motor_on_a_door_is_tampering(robot_model: RobotModel, world: World) -> None:
    with PyBulletRobot(robot_model, world) as robot:
        client = robot.client
        body, joint = robot.simulation.built.articulations["fridge/upper_door"]
        robot.clock.sleep(0.1)
        assert client.ledger.counts["tampering"] == 0
        client.setJointMotorControl2(body, joint, pybullet.VELOCITY_CONTROL, targetVelocity=1.0, force=100.0)
        assert client.ledger.counts["tampering"] == 1


def test_mass_is_spread_as_the_shapes_are() -> None:
    slab = PlacedShape(Box((0.2, 0.4, 0.6)), Pose.from_xyz_rpy((1.0, 0.0, 0.0)))
    centre, inertia = mass_distribution([slab], 12.0)
    np.testing.assert_allclose(centre, [1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(inertia, np.diag([0.16 + 0.36, 0.04 + 0.36, 0.04 + 0.16]), atol=1e-9)
    twin = PlacedShape(Box((0.2, 0.4, 0.6)), Pose.from_xyz_rpy((-1.0, 0.0, 0.0)))
    centre, inertia = mass_distribution([slab, twin], 24.0)
    np.testing.assert_allclose(centre, 0.0, atol=1e-9)
    assert inertia[2, 2] == pytest.approx(2 * (0.2 + 12.0))
