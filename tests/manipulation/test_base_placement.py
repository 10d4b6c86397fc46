from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.manipulation.base_placement import BasePlacements, ReachingArm
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.scene_from_world_model import planning_scene_from_world_model
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.reachability_map import ReachabilitySampling
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel, BaseModel
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap
from bestman_bt.world_model.world_model import BasePose, WorldModel

TABLE = MapFurniture("table", Pose2D(3.0, 1.0, math.pi / 2), (0.8, 1.6), 0.72, (), False)
OBJECT = np.array([3.1, 0.9, 0.77])


def grasps(position: np.ndarray) -> list[tuple[Pose, Pose]]:
    return [
        tuple(Pose.from_xyz_rpy(np.add(position, [0, 0, above]), (math.pi, 0, yaw)) for above in (0.12, 0.02))
        for yaw in np.arange(0, 2 * np.pi, np.pi / 3)
    ]


@pytest.fixture(scope="module")
def mobile(diff_panda):
    limits = diff_panda.of(ArmModel)["arm"]
    return DampedLeastSquares(diff_panda), limits, diff_panda.posture("home", limits.joint_names)


def front_of(robot):
    return max(x for x, _ in robot.of(BaseModel)["base"].footprint)


def test_stands_face_the_asked_side_and_keep_the_gap(diff_panda):
    front = front_of(diff_panda)
    parameters = BasePlacements(gaps=(0.1,), offsets=(0.0,))
    normals = {"front": (-1, 0), "back": (1, 0), "left": (0, 1), "right": (0, -1)}
    for side, normal in normals.items():
        (stand,) = parameters.beside(TABLE, OBJECT, front, (side,))
        in_furniture = TABLE.pose.inverse() @ stand
        depth = TABLE.footprint[0 if normal[0] else 1] / 2
        assert np.dot([in_furniture.x, in_furniture.y], normal) == pytest.approx(depth + front + 0.1)
        assert np.allclose([math.cos(in_furniture.theta), math.sin(in_furniture.theta)], np.negative(normal))
    with pytest.raises(ManipulationError, match="side should be one of front, back, left, right but is 'top'"):
        BasePlacements().beside(TABLE, OBJECT, front, ("top",))


def test_every_ranked_stand_reaches_the_object_without_touching_the_table(diff_panda, mobile, rng):
    kinematics, limits, home = mobile
    model = CoalCollisionModel(diff_panda)
    semantic_map = SemanticMap(np.zeros((0, 4)), {"table": TABLE})

    def world_at(stand: Pose2D):
        belief = WorldModel(semantic_map, base=BasePose(stand, 0.01, 0.01, 0.0))
        return model.world(planning_scene_from_world_model(belief, diff_panda, diff_panda.postures["home"]))

    candidates = BasePlacements().beside(TABLE, OBJECT, front_of(diff_panda))
    alternatives = grasps(OBJECT)
    ranked = BasePlacements().rank(
        candidates, alternatives, ReachingArm(kinematics, limits, home, rng), world_at=world_at
    )
    assert ranked
    assert [stand.score for stand in ranked] == sorted((stand.score for stand in ranked), reverse=True)
    for stand in ranked:
        reached = stand.pose.to_pose() @ kinematics.tool_pose(stand.positions)
        assert np.allclose(reached.position, alternatives[stand.alternative][0].position, atol=1e-3)
        assert world_at(stand.pose).is_free(stand.positions)


@pytest.mark.slow
def test_stands_where_the_base_may_not_be_are_left_out(diff_panda, mobile, rng):
    kinematics, limits, home = mobile
    candidates = BasePlacements().beside(TABLE, OBJECT, front_of(diff_panda))
    ranked = BasePlacements().rank(
        candidates, grasps(OBJECT), ReachingArm(kinematics, limits, home, rng), is_base_free=lambda pose: pose.x > 3.15
    )
    assert ranked
    assert all(stand.pose.x > 3.15 for stand in ranked)


def test_nothing_is_ranked_where_nothing_is_reachable(diff_panda, mobile, rng):
    kinematics, limits, home = mobile
    candidates = BasePlacements().beside(TABLE, OBJECT, front_of(diff_panda))
    assert (
        BasePlacements().rank(
            candidates, grasps(np.add(OBJECT, [0, 0, 1.5])), ReachingArm(kinematics, limits, home, rng)
        )
        == ()
    )
    with pytest.raises(ManipulationError, match="alternatives"):
        BasePlacements().rank(candidates, [], ReachingArm(kinematics, limits, home, rng))


def test_of_equal_stands_the_nearer_one_is_preferred(diff_panda, mobile, rng):
    kinematics, limits, home = mobile
    sides = [BasePlacements().beside(TABLE, (3.0, 1.0), front_of(diff_panda), (side,)) for side in ("front", "back")]
    assert sides[1]
    target = np.array([3.0, 1.0, 0.77])
    ranked = BasePlacements().rank(
        sides[0] + sides[1],
        grasps(target),
        ReachingArm(kinematics, limits, home, rng),
        current=Pose2D(3.0, 3.0, -math.pi / 2),
    )
    assert ranked[0].pose in sides[1]


@pytest.mark.slow
def test_a_reachability_map_puts_the_stands_that_reach_first(diff_panda, mobile, rng):
    kinematics, limits, home = mobile
    map_ = ReachabilitySampling(samples=100_000).build(kinematics, limits)
    near = BasePlacements().beside(TABLE, OBJECT, front_of(diff_panda))
    far = tuple(stand @ Pose2D(-0.6, 0.0, 0.0) for stand in near)
    asked = []

    def is_base_free(stand: Pose2D) -> bool:
        asked.append(stand)
        return True

    ranked = BasePlacements().rank(
        far + near, grasps(OBJECT), ReachingArm(kinematics, limits, home, rng, map_), is_base_free
    )
    assert len(ranked) == BasePlacements().enough
    assert all(stand.pose in near for stand in ranked)
    assert len(asked) <= len(ranked) + 2
