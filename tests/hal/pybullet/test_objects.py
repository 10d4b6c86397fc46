"""The shipped objects in physics: they stand, they touch where they are seen, they look as large as they are."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.rendering import DepthNoise, render_view
from bestman_bt.configuration.data import data_names
from bestman_bt.messages import Mesh, ObjectModel, Pose
from bestman_bt.scene.object_file import read_object
from bestman_bt.scene.scene import PlacedObject, World
from hal.pybullet.body_urdf import MARGIN, without_margin
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.ground_truth import GroundTruth

NAMES = data_names("object")
EXACT = DepthNoise(base=0.0, quadratic=0.0, edge_dropout=0.0, dropout=0.0, quantum=1e-6)


def place(number: int, model: ObjectModel) -> Pose:
    """On the floor, away from the robot, each with another yaw."""
    x, y = 1.0 + 0.4 * (number // 6), -1.0 + 0.4 * (number % 6)
    return Pose.from_xyz_rpy((x, y, -model.bounds()[0, 2]), (0.0, 0.0, 0.7 * number))


@pytest.fixture(scope="module")
def after_two_seconds(robot_model, empty_world: World) -> Iterator[GroundTruth]:
    objects = tuple(PlacedObject(name, model := read_object(name), place(i, model)) for i, name in enumerate(NAMES))
    world = World("objects", 0, empty_world.walls, (), objects, empty_world.robot_start, {})
    with PyBulletRobot(robot_model, world, seed=1) as robot:
        truth = GroundTruth(robot)
        robot.clock.sleep(2.0)
        yield truth


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("name", NAMES)
def test_an_object_stands_still_on_the_floor_for_two_seconds(after_two_seconds: GroundTruth, name: str) -> None:
    put = place(NAMES.index(name), read_object(name))
    stands = after_two_seconds.object_pose(name)
    tilt = math.acos(min(1.0, float(stands.rotation[2, 2])))
    assert tilt < math.radians(1.0)
    np.testing.assert_allclose(stands.position, put.position, atol=5e-4)
    assert stands.yaw == pytest.approx(put.yaw, abs=math.radians(1.0))


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("name", NAMES)
def test_a_camera_sees_an_object_as_large_as_its_bounding_box(name: str) -> None:
    model = read_object(name)
    distance = 1.2 * float(np.linalg.norm(model.size)) + 0.1
    views = [
        render_view(model.appearance, looking_at_origin(side * distance), np.random.default_rng(0), EXACT)
        for side in (1.0, -1.0)
    ]
    points = np.concatenate([view.cloud().points for view in views])
    pixel = distance / views[0].image.intrinsics.fx
    seen = np.stack([points.min(axis=0), points.max(axis=0)])
    np.testing.assert_allclose(seen, model.bounds(), atol=0.001 + 2 * pixel)


def looking_at_origin(distance: float) -> Pose:
    direction = np.array([0.55, 0.6, 0.58]) / np.linalg.norm([0.55, 0.6, 0.58])
    eye = direction * distance
    z = -eye / np.linalg.norm(eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.column_stack([x, np.cross(z, x), z]), eye
    return Pose.from_matrix(matrix)


def test_convex_parts_rest_on_the_floor_without_a_gap(after_two_seconds: GroundTruth) -> None:
    """Pybullet puts a margin of a millimetre around meshes; the parts are made smaller by that."""
    for name in ("mug", "bowl", "duck"):
        stands = after_two_seconds.object_pose(name).position[2]
        assert stands + read_object(name).bounds()[0, 2] == pytest.approx(0.0, abs=1e-4)


def test_a_part_too_thin_for_the_margin_keeps_some_thickness() -> None:
    corners = np.array([[x, y, z] for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (-0.0006, 0.0006)])
    thin = without_margin(Mesh(corners, np.array([[0, 1, 2]])))
    assert 0.0 < np.ptp(thin.vertices[:, 2]) < 0.0012
    thick = without_margin(Mesh(corners * [1, 1, 10], np.array([[0, 1, 2]])))
    np.testing.assert_allclose(np.ptp(thick.vertices, axis=0), np.array([0.04, 0.04, 0.012]) - 2 * MARGIN, atol=1e-9)
