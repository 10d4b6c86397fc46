"""Planning in front of doors and drawers leaves the simulated world as it is, to the last bit."""

import hashlib
import pickle

import numpy as np

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.scene_from_world_model import planning_scene_from_world_model
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Pose
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.world_model import BasePose, WorldModel
from hal.pybullet.robot import PyBulletRobot

DRAWER = "drawer_chest/drawer_3"


def state(robot: PyBulletRobot) -> str:
    """A hash of the poses and velocities of all bodies and of all their joints."""
    client = robot.client
    values = []
    for body in range(client.getNumBodies()):
        values.append((client.getBasePositionAndOrientation(body), client.getBaseVelocity(body)))
        values += [client.getJointState(body, joint) for joint in range(client.getNumJoints(body))]
    return hashlib.sha256(pickle.dumps(values)).hexdigest()


def test_planning_beside_an_open_drawer_changes_nothing_in_physics(robot_model):
    world = draw_world(load_scene("chest_room"), seed=3)
    with PyBulletRobot(robot_model, world, seed=3) as robot:
        chest = semantic_map(world).furniture["drawer_chest"]
        before_it = chest.pose.to_pose() @ Pose.from_xyz_rpy((1.1, 0.0, 0.0), (0.0, 0.0, np.pi))
        belief = WorldModel(semantic_map(world), base=BasePose(before_it.to_pose2d(), 0.01, 0.01, 0.0))
        belief.articulations[DRAWER] = 0.2
        start = np.array(robot.parts["arm"].positions())
        arm, rng = robot_model.of(ArmModel)["arm"], np.random.default_rng(5)
        positions = dict(zip(arm.joint_names, start, strict=True))
        scene = planning_scene_from_world_model(belief, robot_model, positions, hollow=["drawer_chest"])
        assert any(obstacle.name.startswith(DRAWER) for obstacle in scene.obstacles)
        free = CoalCollisionModel(robot_model).world(scene)
        target = Pose.from_xyz_rpy((0.55, 0.2, 1.0), (np.pi, 0.0, 0.0))

        before = state(robot)
        goals = DampedLeastSquares(robot_model).solve(target, start, rng, count=2, is_valid=free.is_free).solutions
        planned = TimedMotionPlanner(RRTConnect(), Toppra()).plan(start, goals, free, arm, rng)

        assert planned.trajectory.duration > 0.5
        assert state(robot) == before
        body, joint = robot.simulation.built.articulations[DRAWER]
        robot.client.resetJointState(body, joint, 1e-4)
        assert state(robot) != before
