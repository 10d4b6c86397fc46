"""What a camera has seen, and nothing believed explains, is kept clear; what the robot grasps or stands in is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle, VoxelObstacle
from bestman_bt.manipulation.collision.scene_from_world_model import SceneMargins, planning_scene_from_world_model
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
from bestman_bt.manipulation.trajectory.base import first_touch
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, Pose2D, VoxelGrid
from bestman_bt.perception.occupancy import LogOdds, VoxelRegion
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap
from bestman_bt.world_model.world_model import BasePose, HeldObject, ObjectBelief, WorldModel
from tests.manipulation.table_and_shelf import FINGERS
from tests.perception.seen_boxes import looking_at, view_of

BASE = Pose2D(1.0, 0.5, 0.3)
TABLE = MapFurniture("table", Pose2D(1.9, 0.8, 0.3), (0.7, 1.2), 0.72, (), False)
TOP = PlacedShape(Box((0.7, 1.2, 0.04)), Pose.from_xyz_rpy((1.9, 0.8, 0.70), (0, 0, 0.3)))
PILLAR = PlacedShape(Box((0.08, 0.10, 0.45)), BASE.to_pose() @ Pose(np.array([0.7, 0.0, 0.95])))
"""A thing that no map and no model knows, in the map frame, straight before the arm."""
REGION = VoxelRegion(BASE.to_pose() @ Pose(np.array([0.8, 0.0, 1.0])), (1.2, 1.4, 1.0))
LEFT = np.array([0.6, 0.35, 0.0, -1.75, 0.0, 2.1, 0.785])
RIGHT = LEFT * [-1, 1, 1, 1, 1, 1, 1]


@pytest.fixture(scope="module")
def grid() -> VoxelGrid:
    """The table and the pillar, as seen from two places."""
    eyes = [BASE.apply(np.array([xy])).ravel() for xy in ([-0.2, 0.0], [0.5, 0.9])]
    views = [
        view_of((TOP, PILLAR), looking_at((*eye, 1.7), PILLAR.pose.position), 1.0, np.random.default_rng(1))
        for eye in eyes
    ]
    return LogOdds().fuse(views, REGION)


@pytest.fixture
def belief(grid) -> WorldModel:
    world = WorldModel(SemanticMap(np.zeros((0, 4)), {"table": TABLE}), base=BasePose(BASE, 0.01, 0.01, 0.0))
    world.occupancy = grid
    return world


@pytest.fixture(scope="module")
def collision_of(diff_panda):
    return CoalCollisionModel(diff_panda)


def positions(robot, arm_positions=LEFT) -> dict[str, float]:
    return {
        **robot.postures["home"],
        **FINGERS,
        **dict(zip(robot.of(ArmModel)["arm"].joint_names, arm_positions, strict=True)),
    }


def scene_of(belief, robot, arm_positions=LEFT, **options) -> PlanningScene:
    return planning_scene_from_world_model(belief, robot, positions(robot, arm_positions), **options)


def centres(voxels: VoxelObstacle) -> np.ndarray:
    """In the base frame."""
    return voxels.base_from_grid.apply((voxels.indices + 0.5) * voxels.resolution)


def test_a_thing_that_nobody_knows_is_avoided_by_a_planned_motion(belief, diff_panda, collision_of):
    arm = diff_panda.of(ArmModel)["arm"]
    planner = TimedMotionPlanner(RRTConnect(), Toppra())
    in_base = replace(PILLAR, pose=BASE.to_pose().inverse() @ PILLAR.pose)
    blind = replace(belief, occupancy=None)
    truth = collision_of.world(scene_of(blind, diff_panda).adding(SceneObstacle("pillar", (in_base,))))
    motions = [
        planner.plan(LEFT, [RIGHT], collision_of.world(scene_of(b, diff_panda)), arm, np.random.default_rng(2))
        for b in (blind, belief)
    ]
    touches = [first_touch(motion.trajectory, truth) for motion in motions]
    assert touches[0] is not None
    assert all("pillar" in pair for pair in touches[0].pairs)
    assert touches[1] is None


def test_only_what_nothing_believed_explains_is_an_obstacle(belief, diff_panda):
    (voxels,) = scene_of(belief, diff_panda).voxels
    assert voxels.name == "occupied"
    in_pillar = BASE.to_pose().inverse() @ PILLAR.pose
    local = in_pillar.inverse().apply(centres(voxels))
    assert (np.abs(local) < np.array([0.08, 0.10, 0.45]) / 2 + 0.025).all()
    assert len(local) > 100


def test_a_believed_object_and_the_target_of_a_grasp_explain_what_was_seen_of_them(belief, diff_panda):
    model = ObjectModel("pillar", (1, 0, 0), 1.0, 0.8, (PlacedShape(PILLAR.shape, Pose()),))
    belief.objects["pillar"] = ObjectBelief("pillar", model, PILLAR.pose, 0.9, 0.002, 0.0, "table/top")
    assert scene_of(belief, diff_panda).voxels == ()
    without = scene_of(belief, diff_panda, ignore=["pillar"])
    assert without.voxels == ()
    assert "pillar" not in {obstacle.name for obstacle in without.obstacles}
    belief.objects.clear()
    in_base = replace(PILLAR, pose=BASE.to_pose().inverse() @ PILLAR.pose)
    assert scene_of(belief, diff_panda, explained=[in_base]).voxels == ()


@pytest.mark.slow
def test_unknown_space_counts_as_filled_when_asked(belief, diff_panda, collision_of):
    asked = SceneMargins(unknown_is_obstacle=True)
    names = [voxels.name for voxels in scene_of(belief, diff_panda, margins=asked).voxels]
    assert names == ["occupied", "unknown"]
    known = collision_of.world(scene_of(belief, diff_panda).without("occupied"))
    cautious = collision_of.world(scene_of(belief, diff_panda, margins=asked).without("occupied"))
    rng = np.random.default_rng(4)
    postures = LEFT + rng.normal(0.0, 0.4, (100, 7))
    refused = [q for q in postures if known.is_free(q) and not cautious.is_free(q)]
    assert len(refused) > 5
    assert all("unknown" in pair for q in refused for pair in cautious.colliding_pairs(q))
    assert any(cautious.is_free(q) for q in postures)


@pytest.mark.slow
def test_where_the_robot_is_now_nothing_else_is(belief, diff_panda, collision_of):
    """A scan that took the robot for a thing, or a space that it has never seen, does not lock its arm."""
    everything = VoxelGrid(np.full(belief.occupancy.states.shape, 2, np.uint8), 0.02, REGION.frame_from_grid, 0.0)
    belief.occupancy = everything
    belief.map.furniture.clear()
    world = collision_of.world(scene_of(belief, diff_panda, arm_positions=LEFT))
    assert world.is_free(LEFT)
    assert not world.is_free(RIGHT)
    box = ObjectModel("box", (1, 0, 0), 0.2, 0.8, (PlacedShape(Box((0.2, 0.06, 0.2)), Pose()),))
    belief.hands["arm"] = HeldObject("box", box, Pose(), 0.06)
    assert collision_of.world(scene_of(belief, diff_panda, arm_positions=LEFT)).is_free(LEFT)


def test_what_is_held_must_not_touch_what_was_seen_either(belief, diff_panda, collision_of):
    before_the_pillar = Pose.from_xyz_rpy((0.5, 0.0, 1.1), (np.pi, 0, 0))
    near = DampedLeastSquares(diff_panda).solve(before_the_pillar, LEFT, np.random.default_rng(0)).best
    empty = collision_of.world(scene_of(belief, diff_panda))
    stick = ObjectModel("stick", (1, 0, 0), 0.2, 0.8, (PlacedShape(Box((0.5, 0.02, 0.02)), Pose()),))
    belief.hands["arm"] = HeldObject("stick", stick, Pose(), 0.02)
    holding = collision_of.world(scene_of(belief, diff_panda))
    assert empty.is_free(near)
    assert ("occupied", "stick") in holding.colliding_pairs(near)


@pytest.mark.slow
def test_voxels_are_as_solid_as_boxes_of_their_size(diff_panda, collision_of):
    rng = np.random.default_rng(3)
    indices = np.unique(rng.integers([20, -25, 25], [45, 25, 50], (300, 3)), axis=0)
    pose = Pose.from_xyz_rpy((0.01, 0.02, 0.2), (0.05, 0.0, 0.4))
    boxes = tuple(PlacedShape(Box((0.02,) * 3), pose @ Pose((index + 0.5) * 0.02)) for index in indices)
    arm = diff_panda.of(ArmModel)["arm"]
    carry = {**diff_panda.postures["carry"], **FINGERS}
    for padding in (0.002, 0.03):
        scene = PlanningScene(carry, padding=padding)
        as_voxels = collision_of.world(replace(scene, voxels=(VoxelObstacle("seen", pose, indices, 0.02),)))
        as_boxes = collision_of.world(scene.adding(SceneObstacle("seen", boxes)))
        answers = [
            (as_voxels.is_free(q), as_boxes.is_free(q)) for q in rng.uniform(arm.lower, arm.upper, (60, len(arm.lower)))
        ]
        assert all(a == b for a, b in answers)
        assert 5 < sum(a for a, _ in answers) < 55
    home = diff_panda.posture("home", arm.joint_names)
    distances = [(as_voxels.distance(q), as_boxes.distance(q)) for q in home + rng.normal(0, 0.2, (6, 7))]
    assert [a for a, _ in distances] == pytest.approx([b for _, b in distances], abs=1e-6)


def test_without_a_scan_there_are_no_voxels(belief, diff_panda):
    assert scene_of(replace(belief, occupancy=None), diff_panda).voxels == ()
