"""The world that is built is the world that was drawn."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.messages import Cylinder, Mesh, ObjectModel, PlacedShape, Pose
from bestman_bt.scene.scene import PlacedObject
from hal.api import NotConnectedError
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.bodies import SimulationError, Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.scene_recorder import SceneRecorder


def test_furniture_stands_where_it_is_and_not_where_the_map_has_it(robot_model, table_worlds) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"]) as robot:
        pose = GroundTruth(robot).furniture_pose("table")
        assert pose.position[:2] == pytest.approx([0.86, 0.01], abs=1e-9)
        assert pose.yaw == pytest.approx(0.01)


def test_objects_and_robot_stand_where_they_were_drawn(robot_model, table_worlds) -> None:
    with PyBulletRobot(robot_model, table_worlds["can"]) as robot:
        truth = GroundTruth(robot)
        assert truth.object_pose("can").position == pytest.approx([0.65, -0.1, 0.80], abs=0.002)
        assert truth.object_pose("can").yaw == pytest.approx(0.3, abs=0.01)
        assert truth.base_pose().position == pytest.approx([0.0, 0.0, 0.0], abs=0.003)
        assert truth.supports("can") == ("table",)
        assert not truth.touches_robot("can")
        assert truth.object_speed("can")[0] < 1e-3


def test_the_robot_starts_in_its_carry_posture(robot_model, empty_world) -> None:
    with PyBulletRobot(robot_model, empty_world) as robot:
        arm = robot.parts["arm"]
        assert arm.positions() == pytest.approx(robot_model.posture("carry", arm.joint_names), abs=1e-3)
        assert robot.parts["gripper"].width() == pytest.approx(0.08, abs=1e-3)


def test_two_bodies_of_one_name_are_refused(robot_model, table_worlds) -> None:
    world = table_worlds["box"]
    twins = dataclasses.replace(world, objects=world.objects * 2)
    with pytest.raises(SimulationError, match="need unique names"):
        PyBulletRobot(robot_model, twins).connect()


def test_shapes_keep_their_place_and_rotation_in_a_body(robot_model, empty_world) -> None:
    """A lying cylinder, which needs a pitch of 90 degrees, and a mesh; seen by rays."""
    lying = PlacedShape(Cylinder(0.05, 0.4), Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.3, np.pi / 2, 0.2)))
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.1, 0.1)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip
    cube = PlacedShape(Mesh(corners, faces), Pose.from_xyz_rpy((0.0, 0.0, 0.0)))
    objects = (
        PlacedObject("roller", ObjectModel("roller", (1, 0, 0), 1.0, 0.8, (lying,)), Pose.from_xyz_rpy((2, 0, 1.0))),
        PlacedObject("cube", ObjectModel("cube", (1, 0, 0), 1.0, 0.8, (cube,)), Pose.from_xyz_rpy((2, 2, 1.0))),
    )
    world = dataclasses.replace(empty_world, objects=objects)
    robot = PyBulletRobot(robot_model, world)
    with robot:
        built, client = robot.simulation.built, robot.client
        lower, upper = (np.array(corner) for corner in client.getAABB(built.objects["cube"]))
        assert upper - lower == pytest.approx([0.2, 0.4, 0.2], abs=0.02)
        axis = lying.pose.rotation[:, 2]
        lower, upper = (np.array(corner) for corner in client.getAABB(built.objects["roller"]))
        assert (upper - lower)[:2] == pytest.approx(0.4 * np.abs(axis[:2]) + 0.1 * np.sqrt(1 - axis[:2] ** 2), abs=0.03)


def test_what_is_not_there_is_refused_with_the_names_there_are(robot_model, table_worlds) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"]) as robot:
        truth = GroundTruth(robot)
        with pytest.raises(SimulationError, match="no object 'cup'; there is box"):
            truth.object_pose("cup")
        with pytest.raises(SimulationError, match="has no link 'tail'"):
            truth.frame_pose("tail")


def test_there_is_no_truth_without_a_connection(robot_model, empty_world) -> None:
    with pytest.raises(NotConnectedError, match="connect"):
        GroundTruth(PyBulletRobot(robot_model, empty_world))


def test_a_snapshot_holds_the_whole_scene(robot_model, table_worlds) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"]) as robot:
        truth, recorder = GroundTruth(robot), SceneRecorder(robot)
        robot.clock.sleep(0.1)
        snapshot = recorder.scene_snapshot()
        assert snapshot.stamp == robot.clock.now()
        assert snapshot.base_pose.position == pytest.approx(truth.base_pose().position)
        assert snapshot.object_poses["box"].position == pytest.approx(truth.object_pose("box").position)
        assert snapshot.joint_positions["panda_joint2"] == pytest.approx(-1.6, abs=1e-3)
        assert robot.audit_record().truth_reads == 0


def test_a_picture_shows_the_object(robot_model, table_worlds) -> None:
    with PyBulletRobot(robot_model, table_worlds["box"]) as robot:
        viewpoint = Viewpoint(eye=(0.3, -1.2, 1.6), target=(0.65, -0.1, 0.8), field_of_view=20.0)
        picture = ScenePhotographer(robot).picture(viewpoint, 160, 120, oversampling=2)
        assert picture.shape == (120, 160, 3)
        red, green, _ = picture[50:70, 70:90].reshape(-1, 3).mean(axis=0)
        assert red > 2 * green


@pytest.mark.slow
def test_an_object_that_rests_sleeps_and_does_not_move_at_all(robot_model, table_worlds) -> None:
    with PyBulletRobot(robot_model, table_worlds["can"]) as robot:
        truth = GroundTruth(robot)
        robot.clock.sleep(3.0)
        asleep = truth.object_pose("can").matrix
        robot.clock.sleep(0.5)
        assert np.array_equal(truth.object_pose("can").matrix, asleep)


def test_frames_that_are_no_links_in_physics_are_where_they_belong(robot_model, empty_world) -> None:
    with PyBulletRobot(robot_model, empty_world) as robot:
        truth = GroundTruth(robot)
        hand, tool = truth.frame_pose("panda_hand"), truth.frame_pose("panda_grasptarget")
        assert (hand.inverse() @ tool).position == pytest.approx([0.0, 0.0, 0.105], abs=1e-6)


def test_equal_meshes_share_a_file_in_all_worlds_of_a_process_which_removes_them_at_its_end() -> None:
    program = """
from bestman_bt.messages import Mesh, PlacedShape, Pose
from hal.pybullet.body_urdf import body_urdf, mesh_file

corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
meshes = [Mesh(np.array(corners) * size, np.array(faces)) for size in (0.1, 0.1, 0.2)]
urdfs = [body_urdf(f"body_{i}", 1.0, (), [(PlacedShape(mesh, Pose()), (1, 0, 0, 1))]) for i, mesh in enumerate(meshes)]
files = [mesh_file(mesh) for mesh in meshes]
assert all(str(file) in urdf for file, urdf in zip(files, urdfs))
assert files[0] == files[1] != files[2]
assert all(file.stat().st_size for file in files)
print(files[0].parent)
"""
    done = subprocess.run(
        [sys.executable, "-c", "import numpy as np" + program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not Path(done.stdout.strip()).exists()
