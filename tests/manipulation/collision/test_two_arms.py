"""Collision worlds of a robot with two arms whose base frame is turned and moved against its root frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene, SceneObstacle, VoxelObstacle
from bestman_bt.manipulation.collision.scene_from_world_model import (
    finger_contacts,
    hand_links,
    held_object,
    planning_scene_from_world_model,
)
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Box, Mesh, ObjectModel, PlacedShape, Pose, Sphere
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import HeldObject, WorldModel
from tests.manipulation.two_arms import HAND, home, two_arms

SIDES = ("left", "right")
OTHER = {"left": "right", "right": "left"}


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return two_arms()


@pytest.fixture(scope="module")
def model(robot) -> CoalCollisionModel:
    return CoalCollisionModel(robot)


def posture(robot: RobotModel, side: str) -> np.ndarray:
    """No two joints alike, so that another order of the joints is another posture."""
    return home(robot, side) + np.linspace(-0.08, 0.08, 7)


def pose_of(robot: RobotModel, side: str, link: str, positions: np.ndarray | None = None) -> Pose:
    at = posture(robot, side) if positions is None else positions
    named = {**robot.postures["home"], **dict(zip(robot.of(ArmModel)[side].joint_names, at, strict=True))}
    return ForwardKinematics(robot).pose(f"{side}_{link}", named)


def ball(robot: RobotModel, side: str, aside: float, padding: float = 0.0) -> SceneObstacle:
    """A ball of 10 mm beside the palm, along x of its link; the palm is 40 mm thick there."""
    place = pose_of(robot, side, "palm") @ Pose(np.array([aside, 0.0, 0.0]))
    return SceneObstacle("ball", (PlacedShape(Sphere(0.01), Pose(place.position)),), padding)


def bar(robot: RobotModel, side: str, padding: float = 0.0) -> AttachedObject:
    """Held by ``side``, it reaches across to the other hand and ends 56 mm before its palm's corner."""
    sign = -1.0 if side == "left" else 1.0
    shape = PlacedShape(Box((0.02, 0.44, 0.02)), Pose(np.array([0.0, 0.18 * sign, 0.0])))
    hand = frozenset(hand_links(robot, side))
    return AttachedObject("bar", (shape,), f"{side}_tool", Pose(), hand, padding)


def scene(robot: RobotModel, *obstacles: SceneObstacle, **options) -> PlanningScene:
    return PlanningScene(robot.postures["home"], obstacles, **options)


@pytest.mark.parametrize("side", SIDES)
def test_obstacles_stand_in_the_base_frame_and_positions_are_in_the_arms_own_order(model, robot, side):
    world = model.world(scene(robot, ball(robot, side, 0.1)), side)
    assert world.is_free(posture(robot, side))
    assert world.distance(posture(robot, side)) == pytest.approx(0.07, abs=1e-4)
    inside = model.world(scene(robot, ball(robot, side, 0.0)), side)
    assert ("ball", f"{side}_palm") in inside.colliding_pairs(posture(robot, side))


@pytest.mark.parametrize("side", SIDES)
def test_paddings_of_scene_and_obstacle_add_up_and_clearance_is_what_is_left(model, robot, side):
    q = posture(robot, side)
    for padding, free in ((0.0645, True), (0.0655, False)):
        world = model.world(scene(robot, ball(robot, side, 0.1, padding), padding=0.005, self_padding=0.0), side)
        assert world.is_free(q) is free
        assert world.clearance(q) == pytest.approx(0.065 - padding, abs=1e-4)


@pytest.mark.parametrize("side", SIDES)
def test_hands_keep_the_self_padding_from_each_other_and_nothing_else(model, robot, side):
    q = home(robot, side)
    apart = model.world(scene(robot), side).distance(q)
    assert apart == pytest.approx(0.5 - 2 * 0.06, abs=1e-6)
    assert model.world(scene(robot, padding=2 * apart, self_padding=apart - 1e-4), side).is_free(q)
    touching = model.world(scene(robot, padding=0.0, self_padding=apart + 1e-4), side)
    assert touching.colliding_pairs(q) == (("left_palm", "right_palm"),)
    allowed = scene(robot, self_padding=apart + 1e-4).allowing(("right_palm", "left_palm"))
    assert model.world(allowed, side).is_free(q)


@pytest.mark.parametrize("side", SIDES)
def test_what_one_hand_holds_must_not_touch_the_other_hand(model, robot, side):
    q, other = home(robot, side), OTHER[side]
    apart = model.world(scene(robot).holding(bar(robot, side)), side).distance(q)
    assert 0.02 < apart < 0.2
    for padding, free in ((apart - 0.011, True), (apart - 0.009, False)):
        options = {"padding": 0.0, "self_padding": 0.01}
        world = model.world(scene(robot, **options).holding(bar(robot, side, padding)), side)
        assert world.is_free(q) is free
        assert {name for pair in world.colliding_pairs(q) for name in pair} <= {
            "bar",
            f"{other}_palm",
            *_fingers(other),
        }
    near = scene(robot, padding=0.0, self_padding=apart + 0.001).holding(bar(robot, side))
    pairs = model.world(near, side).colliding_pairs(q)
    assert pairs
    assert model.world(near.allowing(*pairs), side).is_free(q)


def _fingers(side: str) -> tuple[str, str]:
    return f"{side}_finger1", f"{side}_finger2"


@pytest.mark.parametrize("side", SIDES)
def test_what_the_other_hand_holds_is_an_obstacle_where_that_arm_is(model, robot, side):
    """The bar of the other hand ends before this arm's palm; it goes where the other arm goes."""
    q, other = home(robot, side), OTHER[side]
    held = bar(robot, other)
    apart = model.world(scene(robot, carried=(held,)), side).distance(q)
    assert 0.02 < apart < 0.2
    for padding, free in ((apart - 0.001, True), (apart + 0.001, False)):
        world = model.world(scene(robot, carried=(held,), padding=padding, self_padding=0.0), side)
        assert world.is_free(q) is free
        assert all("bar" in pair for pair in world.colliding_pairs(q))
    away = {**robot.postures["home"], f"{other}_pan": np.pi / 2 if other == "left" else -np.pi / 2}
    assert model.world(PlanningScene(away, carried=(held,)), side).distance(q) > apart + 0.05


@pytest.mark.parametrize("side", SIDES)
def test_more_is_kept_between_what_a_hand_holds_and_the_other_arm(model, robot, side):
    q, other = home(robot, side), OTHER[side]
    holding = scene(robot, carried=(bar(robot, other),), padding=0.0, self_padding=0.0)
    apart = model.world(holding, side).distance(q)
    for padding, free in ((apart - 0.001, True), (apart + 0.001, False)):
        assert model.world(replace(holding, other_arm_padding=padding), side).is_free(q) is free
    held = scene(robot, padding=0.0, self_padding=0.0, other_arm_padding=0.0).holding(bar(robot, side))
    assert model.world(held, side).is_free(q)
    touched = model.world(replace(held, other_arm_padding=0.5), side).colliding_pairs(q)
    assert touched
    assert all(any(one.startswith(f"{other}_") for one in pair) for pair in touched if "bar" not in pair), touched
    assert not any({"bar", one} == set(pair) for pair in touched for one in pair if one.startswith(f"{side}_")), touched


@pytest.mark.parametrize("side", SIDES)
def test_arms_keep_more_from_each_other_than_links_of_one(model, robot, side):
    q = home(robot, side)
    apart = model.world(scene(robot), side).distance(q)
    for padding, free in ((apart - 0.001, True), (apart + 0.001, False)):
        world = model.world(scene(robot, self_padding=0.0, other_arm_padding=padding), side)
        assert world.is_free(q) is free
        assert world.colliding_pairs(q) == (() if free else (("left_palm", "right_palm"),))


@pytest.mark.parametrize("side", SIDES)
def test_the_padding_of_what_is_held_is_kept_from_obstacles_as_well(model, robot, side):
    q = home(robot, side)
    end = pose_of(robot, side, "tool", q) @ bar(robot, side).shapes[0].pose @ Pose(np.array([0.05, 0.0, 0.0]))
    beside = SceneObstacle("ball", (PlacedShape(Sphere(0.01), Pose(end.position)),), 0.005)
    options = {"padding": 0.004, "self_padding": 0.0}
    assert model.world(scene(robot, beside, **options).holding(bar(robot, side)), side).distance(q) < 0.031
    for padding, free in ((0.0205, True), (0.0215, False)):
        world = model.world(scene(robot, beside, **options).holding(bar(robot, side, padding)), side)
        assert world.is_free(q) is free


@pytest.mark.parametrize("side", SIDES)
def test_only_the_hand_that_holds_may_touch_what_is_held(robot, side):
    held = WorldModel(SemanticMap(np.zeros((0, 4)), {}))
    cup = ObjectModel("cup", (1, 0, 0), 0.2, 0.8, (PlacedShape(Sphere(0.03), Pose()),))
    held.hands[side] = HeldObject("cup", cup, Pose(np.array([0.0, 0.01, 0.02])), 0.06)
    for attached in (
        held_object(held, robot, side),
        planning_scene_from_world_model(held, robot, robot.postures["home"], side).attached,
    ):
        assert attached is not None
        assert attached.touch_links == {f"{side}_{part}" for part in HAND}
        assert attached.tool_frame == f"{side}_tool"
        assert np.array_equal(attached.tool_from_object.position, [0.0, 0.01, 0.02])
    others = planning_scene_from_world_model(held, robot, robot.postures["home"], OTHER[side])
    assert others.attached is None
    assert [carried.tool_frame for carried in others.carried] == [f"{side}_tool"]
    assert finger_contacts(robot, "cup", side) == tuple((link, "cup") for link in _fingers(side))


def test_knuckles_belong_to_the_hand(robot):
    gripper = replace(robot.of(GripperModel)["left_gripper"], linkage=("left_turn_link",))
    linked = replace(robot, parts={**robot.parts, "left_gripper": gripper})
    assert set(hand_links(linked, "left")) == {"left_turn_link", *(f"left_{part}" for part in HAND)}
    assert set(hand_links(linked, "right")) == {f"right_{part}" for part in HAND}


def voxels_at(*places: np.ndarray, padding: float = 0.0) -> VoxelObstacle:
    """Single voxels of 20 mm around places of the base frame; the grid is turned."""
    grid = Pose.from_xyz_rpy((-2.0, -2.0, -1.0), (0.0, 0.0, 0.3))
    indices = np.floor(grid.inverse().apply(np.array(places)) / 0.02).astype(np.int64)
    return VoxelObstacle("seen", grid, indices, 0.02, padding)


@pytest.mark.parametrize("side", SIDES)
def test_voxels_count_but_where_the_robot_or_what_it_holds_is_now(model, robot, side):
    here, there = home(robot, side), posture(robot, side)
    there[robot.of(ArmModel)[side].joint_names.index(f"{side}_pan")] += 0.6
    hands = [pose_of(robot, side, "palm", q).position for q in (here, there)]
    seen = replace(scene(robot), voxels=(voxels_at(*hands),))
    world = model.world(seen, side)
    assert world.is_free(here)
    assert (f"{side}_palm", "seen") in world.colliding_pairs(there)
    offset = Pose.from_xyz_rpy((0.0, 0.0, 0.15), (0.3, 0.0, 0.0))
    block = AttachedObject(
        "block", (PlacedShape(Box((0.02, 0.02, 0.02)), Pose()),), f"{side}_tool", offset, frozenset()
    )
    held = [(pose_of(robot, side, "tool", q) @ offset).position for q in (here, there)]
    holding = model.world(replace(scene(robot), voxels=(voxels_at(*held),)).holding(block), side)
    assert holding.is_free(here)
    assert ("block", "seen") in holding.colliding_pairs(there)


@pytest.mark.parametrize("side", SIDES)
def test_voxels_have_a_padding_of_their_own(model, robot, side):
    q = posture(robot, side)
    beside = (pose_of(robot, side, "palm", q) @ Pose(np.array([0.1, 0.0, 0.0]))).position
    near = model.world(replace(scene(robot), voxels=(voxels_at(beside),)), side).distance(q)
    assert 0.04 < near < 0.1
    for padding, free in ((near - 0.006, True), (near - 0.004, False)):
        world = model.world(replace(scene(robot, padding=0.005), voxels=(voxels_at(beside, padding=padding),)), side)
        assert world.is_free(q) is free


def test_voxels_next_to_the_robot_are_disproved_as_far_as_the_padding_goes(model, robot):
    """A voxel whose middle is 30 mm beside the palm's side: within 17 mm of a voxel's half diagonal and 20 mm."""
    q = home(robot, "left")
    beside = pose_of(robot, "left", "palm", q) @ Pose(np.array([0.05, 0.0, 0.0]))
    for padding in (0.002, 0.02):
        seen = replace(scene(robot, padding=padding), voxels=(voxels_at(beside.position),))
        world = model.world(seen, "left")
        assert world.is_free(q)
        assert (world.distance(q) < 0.03) is (padding < 0.01)


def test_worlds_that_answer_differently_have_different_fingerprints(model, robot):
    first = model.world(scene(robot), "left").fingerprint
    assert model.world(scene(robot), "left").fingerprint == first
    turned = PlanningScene(dict(reversed(robot.postures["home"].items())))
    assert model.world(turned, "left").fingerprint == first
    strict = replace(robot, allowed_self_pairs=frozenset())
    others = [
        model.world(scene(robot), "right"),
        CoalCollisionModel(strict).world(scene(robot), "left"),
        model.world(scene(robot, padding=0.01), "left"),
        model.world(scene(robot, self_padding=0.01), "left"),
        model.world(scene(robot).allowing(("a", "b")), "left"),
        model.world(scene(robot, ball(robot, "left", 0.1)), "left"),
        model.world(scene(robot, ball(robot, "left", 0.1, 0.01)), "left"),
        model.world(scene(robot).holding(bar(robot, "left")), "left"),
        model.world(replace(scene(robot), voxels=(voxels_at(np.array([1.0, 0.0, 1.0])),)), "left"),
    ]
    assert len({first, *(world.fingerprint for world in others)}) == len(others) + 1


def test_a_mesh_is_as_solid_as_its_hull_where_it_stands(model, robot):
    q = home(robot, "left")
    corners = np.array([[x, y, z] for x in (0, 0.02) for y in (0, 0.02) for z in (0, 0.02)], dtype=float)
    faces = np.array([[0, 1, 2], [1, 2, 3], [4, 5, 6], [5, 6, 7], [0, 1, 4], [1, 4, 5], [2, 3, 6], [3, 6, 7]])
    place = pose_of(robot, "left", "palm", q) @ Pose(np.array([0.1, 0.0, 0.0]))
    mesh = SceneObstacle("mesh", (PlacedShape(Mesh(corners, faces), place),))
    assert model.world(scene(robot, mesh), "left").distance(q) == pytest.approx(0.08, abs=1e-4)
