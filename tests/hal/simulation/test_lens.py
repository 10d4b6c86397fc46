"""A simulated lens bends the image as OpenCV's model says, and a simulated camera can fail."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.robot_model.sensor_parts import CameraPart
from hal.api import Camera, NoDataError
from hal.simulation.bodies import SimulationError
from hal.simulation.camera import Lens, SimulatedCamera
from hal.simulation.robot import SimulatedRobot
from hal.simulation.sensor_pipeline import SensorFault
from tests.default_engine import DefaultRobot
from tests.robot_models import seen_through

DISTORTION = (-0.25, 0.08, 0.001, -0.0008, 0.01)
SMALL = CameraIntrinsics(320, 240, 216.0, 216.0, 159.5, 119.5)


@pytest.fixture(scope="module")
def robot(robot_model, table_worlds):
    with DefaultRobot(robot_model, table_worlds["box"], seed=2) as robot:
        yield robot


def camera(robot: SimulatedRobot, intrinsics: CameraIntrinsics = SMALL, **changes) -> SimulatedCamera:
    """The head camera with another model, without noise, in the same world."""
    noiseless = {"noise_base": 0.0, "noise_quadratic": 0.0, "dropout": 0.0, "edge_dropout": 0.0, "depth_step": 0.0}
    model = seen_through(replace(robot.model.of(CameraPart)["head_camera"], **(noiseless | changes)), intrinsics)
    other = SimulatedCamera("head_camera", model, np.random.default_rng(1))
    other.attach(robot.simulation)
    return other


def test_each_pixel_of_a_lens_shows_what_the_ideal_camera_shows_where_the_model_puts_it(robot) -> None:
    ideal = camera(robot).capture()
    bent = camera(robot, intrinsics=replace(SMALL, distortion=DISTORTION)).capture()
    u, v = np.meshgrid(np.arange(20, 300, 7), np.arange(20, 220, 7))
    rays = np.stack([(u - SMALL.cx) / SMALL.fx, (v - SMALL.cy) / SMALL.fy, np.ones(u.shape)], axis=-1).reshape(-1, 3)
    seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), SMALL.matrix, np.array(DISTORTION))
    columns, rows = np.rint(seen.reshape(-1, 2)).astype(int).T
    moved = np.hypot(columns - u.ravel(), rows - v.ravel())
    assert moved.max() > 10
    found = bent.depth[rows, columns]
    around = np.stack([ideal.depth[v.ravel() + i, u.ravel() + j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
    # Rounding moves a sample by up to half a pixel: the depth is one of those around it.
    assert np.mean((found >= around.min(axis=0) - 1e-3) & (found <= around.max(axis=0) + 1e-3)) > 0.995
    colours = np.abs(ideal.rgb[v.ravel(), u.ravel()].astype(int) - bent.rgb[rows, columns]).max(axis=1)
    assert np.mean(colours < 12) > 0.94


def test_a_lens_that_folds_the_image_is_refused() -> None:
    with pytest.raises(SimulationError, match="folds the image of 320 × 240"):
        Lens(replace(SMALL, distortion=(-2.0, 0.0, 0.0, 0.0)))


def test_the_systematic_error_of_the_depth_is_that_of_the_model(robot) -> None:
    true = camera(robot).capture().depth
    told = camera(robot, depth_scale=1.02, depth_offset=0.005).capture().depth
    known = true > 0
    np.testing.assert_allclose(told[known], 1.02 * true[known] + 0.005, atol=1e-6)
    assert (told[~known] == 0).all()


def test_a_camera_fails_as_told_and_works_again(robot) -> None:
    failing = camera(robot)
    good = failing.capture()
    failing.fault = SensorFault.SILENT
    with pytest.raises(NoDataError, match="head_camera delivers no readings"):
        failing.capture()
    failing.fault = SensorFault.BLACK
    black = failing.capture()
    assert not black.rgb.any()
    assert not black.depth.any()
    failing.fault = SensorFault.NO_DEPTH
    blind = failing.capture()
    assert blind.rgb.any()
    assert not blind.depth.any()
    failing.fault = SensorFault.FROZEN
    robot.clock.sleep(0.1)
    assert failing.capture() is blind
    failing.fault = None
    assert failing.capture().stamp > good.stamp


@pytest.mark.slow
def test_stamps_go_on_after_a_new_connection(robot_model, empty_world) -> None:
    robot = DefaultRobot(robot_model, empty_world)
    with robot:
        robot.clock.sleep(0.5)
    with robot:
        began = robot.clock.now()
        robot.clock.sleep(0.2)
        assert began + 0.1 < robot.part("head_camera", Camera).capture().stamp <= robot.clock.now()
