from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.scene_from_world_model import (
    SceneMargins,
    finger_contacts,
    planning_scene_from_world_model,
)
from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap
from bestman_bt.world_model.world_model import BasePose, HeldObject, ObjectBelief, Obstacle, WorldModel

CUP = ObjectModel("cup", (1, 0, 0), 0.2, 0.8, (PlacedShape(Cylinder(0.035, 0.1), Pose()),), symmetry_order=0)
TABLE = MapFurniture("table", Pose2D(1.0, 2.5, math.pi / 2), (0.8, 1.4), 0.7, (), False)
BASE = Pose2D(1.0, 1.7, math.pi / 2)


@pytest.fixture
def belief() -> WorldModel:
    far = MapFurniture("counter", Pose2D(1.0, -4.0), (0.6, 2.0), 0.9, (), True)
    walls = np.array([[-1.0, 3.2, 3.0, 3.2], [-1.0, -5.0, 3.0, -5.0]])
    model = WorldModel(SemanticMap(walls, {"table": TABLE, "counter": far}), base=BasePose(BASE, 0.01, 0.01, 0.0))
    model.objects["cup"] = ObjectBelief("cup", CUP, Pose(np.array([1.1, 2.4, 0.75])), 0.9, 0.002, 0.0, "table/top")
    return model


def scene_of(belief, robot, **options):
    return planning_scene_from_world_model(belief, robot, robot.postures["home"], **options)


def named(scene):
    return {obstacle.name: obstacle for obstacle in scene.obstacles}


def test_what_is_near_is_in_the_scene_and_what_is_far_is_not(belief, diff_panda):
    assert set(named(scene_of(belief, diff_panda))) == {"floor", "wall0", "table", "cup"}


def test_objects_stand_where_they_are_believed_seen_from_the_base(belief, diff_panda):
    (cup,) = named(scene_of(belief, diff_panda))["cup"].shapes
    assert np.allclose(cup.pose.position, [0.7, -0.1, 0.75])
    assert named(scene_of(belief, diff_panda))["cup"].padding == pytest.approx(0.004)


def test_the_box_of_unmeasured_furniture_covers_wherever_it_may_stand(belief, diff_panda):
    (box,) = named(scene_of(belief, diff_panda))["table"].shapes
    half = np.array(box.shape.size[:2]) / 2
    map_from_box = BASE.to_pose() @ box.pose
    for dx in (-0.03, 0.03):
        for dy in (-0.03, 0.03):
            for turn in np.radians([-2.0, 2.0]):
                moved = TABLE.pose @ Pose2D(dx, dy, turn)
                corners = moved.apply(TABLE.pose.inverse().apply(TABLE.corners()))
                inside = map_from_box.inverse().apply(np.column_stack([corners, np.full(4, 0.3)]))[:, :2]
                assert np.all(np.abs(inside) <= half + 1e-3)
    assert np.all(half - np.array(TABLE.footprint) / 2 < 0.06)


def test_a_measurement_of_furniture_replaces_its_box(belief, diff_panda):
    top = PlacedShape(Box((1.4, 0.8, 0.03)), Pose(np.array([1.0, 2.51, 0.69])))
    belief.obstacles["table/top"] = Obstacle("table/top", (top,), 1.0)
    obstacles = named(scene_of(belief, diff_panda))
    assert "table" not in obstacles
    assert np.allclose(obstacles["table/top"].shapes[0].pose.position, [0.81, 0.0, 0.69])


def test_the_held_object_is_in_the_hand_and_no_longer_on_the_table(belief, diff_panda):
    grip = Pose(np.array([0.0, 0.0, 0.02]))
    belief.hands["arm"] = HeldObject("cup", CUP, grip, 0.07)
    scene = scene_of(belief, diff_panda)
    assert "cup" not in named(scene)
    assert scene.attached is not None
    assert scene.attached.tool_frame == diff_panda.of(ArmModel)["arm"].tool_frame
    assert scene.attached.tool_from_object is grip
    assert scene.attached.touch_links == {"panda_hand", "panda_leftfinger", "panda_rightfinger"}


def test_an_object_is_padded_by_twice_its_deviation_but_not_without_end(belief, diff_panda):
    belief.objects["cup"] = replace(belief.objects["cup"], position_std=0.02)
    assert named(scene_of(belief, diff_panda))["cup"].padding == pytest.approx(0.01)
    wide = SceneMargins(object_deviations=3.0, max_object_padding=0.05, padding=0.007)
    scene = scene_of(belief, diff_panda, margins=wide)
    assert named(scene)["cup"].padding == pytest.approx(0.05)
    assert scene.padding == 0.007


def test_furniture_that_was_measured_is_grown_by_its_own_errors(belief, diff_panda):
    """A turn moves the ends of a long side most: 1.4 m by 0.8 m, turned by 1 degree."""
    known = replace(TABLE, position_error=0.004, heading_error=math.radians(1.0))
    belief.map = belief.map.with_furniture(known)
    (box,) = named(scene_of(belief, diff_panda))["table"].shapes
    turn = math.sin(math.radians(1.0))
    assert box.shape.size == pytest.approx((0.8 + 0.008 + 1.4 * turn, 1.4 + 0.008 + 0.8 * turn, 0.7))


def test_walls_stand_on_the_floor_along_their_line_and_join_at_their_ends(belief, diff_panda):
    belief.map = replace(belief.map, walls=np.array([[0.0, 1.0, 0.6, 1.8]]))
    (wall,) = named(scene_of(belief, diff_panda))["wall0"].shapes
    map_from_wall = BASE.to_pose() @ wall.pose
    assert wall.shape.size == pytest.approx((1.02, 0.02, 2.5))
    assert np.allclose(map_from_wall.apply(np.array([[-0.5, 0.0, -1.25]])), [[0.0, 1.0, 0.0]])
    assert np.allclose(map_from_wall.apply(np.array([[0.5, 0.0, -1.25]])), [[0.6, 1.8, 0.0]])


def test_the_floor_begins_at_the_height_of_the_base(belief, diff_panda):
    (floor,) = named(scene_of(belief, diff_panda))["floor"].shapes
    assert floor.pose.position[2] + floor.shape.size[2] / 2 == pytest.approx(0.0)


def test_nearness_is_the_distance_from_the_base_to_the_nearest_point(belief, diff_panda):
    """The table's edge is 0.4 m before the base, its middle 0.8 m; the cup 0.71 m, and 2.6 m from the map's origin."""
    for reach, expected in ((0.35, {"floor"}), (0.45, {"floor", "table"}), (0.72, {"floor", "table", "cup"})):
        scene = scene_of(belief, diff_panda, margins=SceneMargins(reach=reach, furniture_offset=0.0))
        assert set(named(scene)) == expected


def test_what_is_held_is_where_the_tool_has_it(belief, diff_panda):
    """A stick held across the hand, which ends 2 cm beside a wall of the scene, not mirrored into it."""
    grip = Pose.from_xyz_rpy((0.0, 0.15, 0.02), (0.0, 0.0, 0.4))
    belief.hands["arm"] = HeldObject("stick", CUP, grip, 0.07)
    assert np.array_equal(scene_of(belief, diff_panda).attached.tool_from_object.matrix, grip.matrix)


def test_names_can_be_left_out_and_pairs_allowed(belief, diff_panda):
    contacts = finger_contacts(diff_panda, "cup")
    scene = scene_of(belief, diff_panda, ignore=("wall0",)).allowing(*contacts)
    assert "wall0" not in named(scene)
    assert scene.allowed_pairs == {
        frozenset({"panda_leftfinger", "cup"}),
        frozenset({"panda_rightfinger", "cup"}),
    }


def test_a_believed_object_stops_the_hand(belief, diff_panda, rng):
    model = CoalCollisionModel(diff_panda)
    from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares

    kinematics = DampedLeastSquares(diff_panda)
    home = diff_panda.posture("home", kinematics.joint_names)
    at_cup = Pose.from_xyz_rpy((0.7, -0.1, 0.77), (math.pi, 0, 0))
    scene = scene_of(belief, diff_panda)
    blocked = kinematics.solve(at_cup, home, rng, is_valid=model.world(scene).is_free, attempts=10)
    free = kinematics.solve(at_cup, home, rng, is_valid=model.world(scene.without("cup")).is_free, attempts=10)
    assert not blocked.found
    assert blocked.rejected > 0
    assert free.found
