"""All arm motions of a fetch, planned from a world model: stand, pre-grasp, approach, lift, carry upright."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.manipulation.base_placement import BasePlacements, ReachingArm
from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.scene_from_world_model import finger_contacts, planning_scene_from_world_model
from bestman_bt.manipulation.kinematics.cartesian_path import cartesian_path
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
from bestman_bt.manipulation.motion_planning.upright import Upright
from bestman_bt.manipulation.trajectory.base import SpeedScale, first_touch
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Cylinder, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.model import ArmModel, BaseModel
from bestman_bt.world_model.semantic_map import MapFurniture, SemanticMap
from bestman_bt.world_model.world_model import BasePose, HeldObject, ObjectBelief, WorldModel

CUP = ObjectModel("cup", (1, 0, 0), 0.2, 0.8, (PlacedShape(Cylinder(0.035, 0.1), Pose()),), symmetry_order=0)
TABLE = MapFurniture("table", Pose2D(3.0, 1.0), (0.8, 1.6), 0.72, (), False)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_cup_is_reached_lifted_and_carried_upright(diff_panda, seed):
    rng = np.random.default_rng(seed)
    arm = diff_panda.of(ArmModel)["arm"]
    carry = diff_panda.posture("carry", arm.joint_names)
    kinematics, model = DampedLeastSquares(diff_panda), CoalCollisionModel(diff_panda)
    planner = TimedMotionPlanner(RRTConnect(), Toppra())
    belief = WorldModel(SemanticMap(np.zeros((0, 4)), {"table": TABLE}))
    cup = np.array([3.0 + rng.uniform(-0.28, 0.1), 1.0 + rng.uniform(-0.5, 0.5), 0.77])
    belief.objects["cup"] = ObjectBelief("cup", CUP, Pose(cup), 0.9, 0.002, 0.0, "table/top")
    grasps = [
        [Pose.from_xyz_rpy(np.add(cup, [0, 0, above]), (math.pi, 0, yaw)) for above in (0.14, 0.02)]
        for yaw in np.arange(0, 2 * np.pi, np.pi / 4)
    ]

    front = max(x for x, _ in diff_panda.of(BaseModel)["base"].footprint)
    search = BasePlacements()
    stands = search.rank(search.beside(TABLE, cup, front), grasps, ReachingArm(kinematics, arm, carry, rng))
    stand = stands[0].pose @ Pose2D(*rng.normal(0, 0.01, 2), rng.normal(0, 0.01))
    belief.base = BasePose(stand, 0.01, 0.01, 0.0)
    base_from_map = stand.to_pose().inverse()

    positions = {**diff_panda.postures["carry"], "panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04}
    scene = planning_scene_from_world_model(belief, diff_panda, positions)
    world = model.world(scene)
    closing = model.world(scene.allowing(*finger_contacts(diff_panda, "cup")))
    candidates = []
    for pre_grasp, grasp in grasps:
        for q in kinematics.solve(base_from_map @ pre_grasp, carry, rng, 2, world.is_free, 15).solutions:
            approach = cartesian_path(kinematics, q, base_from_map @ grasp, closing.is_free)
            if approach.complete:
                candidates.append((q, approach))
    assert len(candidates) >= 4

    reach = planner.plan(carry, [q for q, _ in candidates], world, arm, rng)
    approach = candidates[reach.plan.goal_index][1]
    down = planner.follow_path(approach.path, closing, arm, SpeedScale(0.2, 0.2))
    assert np.array_equal(reach.trajectory.positions[-1], down.positions[0])

    at_grasp = kinematics.tool_pose(down.positions[-1])
    tool_from_cup = at_grasp.inverse() @ base_from_map @ Pose(cup)
    belief.hands["arm"] = HeldObject("cup", CUP, tool_from_cup, 0.07)
    scene = planning_scene_from_world_model(
        belief, diff_panda, {**positions, "panda_finger_joint1": 0.035, "panda_finger_joint2": 0.035}
    )
    lifting = model.world(scene.allowing(("cup", "table")))
    up = cartesian_path(
        kinematics,
        down.positions[-1],
        Pose(np.add(at_grasp.position, [0, 0, 0.15]), at_grasp.quaternion),
        lifting.is_free,
    )
    assert up.complete

    upright = Upright(kinematics, tool_from_cup)
    away = planner.plan(up.path[-1], [carry], model.world(scene), arm, rng, constraint=upright)
    assert first_touch(away.trajectory, model.world(scene)) is None
    tilts = [(kinematics.tool_pose(q) @ tool_from_cup).tilt for q in away.trajectory.positions]
    assert max(tilts) < math.radians(27.0)
