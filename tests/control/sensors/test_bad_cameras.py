"""What the sensor makes of lenses, of wrong depths and of cameras that stop delivering."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.control.rgbd import CameraError, CameraErrorCode, RGBDSensor
from bestman_bt.messages import CameraIntrinsics, RGBDImage
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.robot_model.sensor_parts import CameraPart
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.world_model import WorldModel
from hal.api import Camera
from hal.simulation.camera import SimulatedCamera
from hal.simulation.sensor_pipeline import SensorFault
from tests.robot_models import seen_through


@pytest.fixture
def camera(robot) -> Iterator[SimulatedCamera]:
    camera = robot.parts["head_camera"]
    yield camera
    camera.fault = None


@pytest.fixture
def sensor(robot, camera, kinematics, joints, world) -> RGBDSensor:
    return RGBDSensor(camera, kinematics, joints, WorldModel(semantic_map(world)), robot.clock)


class Playback(Camera):
    """A camera that delivers what it is given."""

    def __init__(self, like: Camera, image: RGBDImage) -> None:
        super().__init__(like.name)
        self.like, self.image = like, image

    @property
    def intrinsics(self) -> CameraIntrinsics:
        return self.image.intrinsics

    @property
    def optical_frame(self) -> str:
        return self.like.optical_frame

    def capture(self) -> RGBDImage:
        return self.image


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("fault", "code", "words"),
    [
        (SensorFault.SILENT, CameraErrorCode.NO_IMAGE, "head_camera gave no image: head_camera delivers no readings"),
        (SensorFault.BLACK, CameraErrorCode.BLACK, "head_camera gave a black image"),
        (SensorFault.NO_DEPTH, CameraErrorCode.NO_DEPTH, r"without depth \(0.00% of its pixels"),
        (SensorFault.FROZEN, CameraErrorCode.STALE, r"is 0.[67]\d s old, 0.5 s are allowed"),
    ],
)
def test_a_camera_that_stops_delivering_is_reported_with_code_and_words(robot, sensor, camera, fault, code, words):
    sensor.capture()
    robot.clock.sleep(0.6)
    camera.fault = fault
    with pytest.raises(CameraError, match=words) as error:
        sensor.capture()
    assert error.value.code is code
    assert isinstance(error.value, PerceptionError)
    camera.fault = None
    robot.clock.sleep(0.1)
    assert 0.0 <= robot.clock.now() - sensor.capture().stamp <= 0.05 + 1 / 30 + 0.01, "a latency and a frame"


class Held(Playback):
    """A camera whose first images come late."""

    def __init__(self, like: Camera, image: RGBDImage, late: int) -> None:
        super().__init__(like, image)
        self.late = late
        self.taken = 0

    def capture(self) -> RGBDImage:
        self.taken += 1
        age = 0.7 if self.taken <= self.late else 0.0
        return replace(self.image, stamp=self.image.stamp - age)


@pytest.mark.parametrize("late", [4, 5])
def test_of_images_that_were_held_up_five_are_asked_for_at_most(robot, camera, kinematics, joints, world, late):
    held = Held(camera, replace(camera.capture(), stamp=robot.clock.now()), late)
    sensor = RGBDSensor(held, kinematics, joints, WorldModel(semantic_map(world)), robot.clock)
    if late < 5:
        assert sensor.capture().stamp == held.image.stamp
    else:
        with pytest.raises(CameraError, match=r"is 0.70 s old"):
            sensor.capture()
    assert held.taken == 5


def test_nobody_is_shown_an_image_that_is_none(sensor, camera):
    shown = []
    sensor.subscribe(shown.append)
    camera.fault = SensorFault.BLACK
    with pytest.raises(CameraError):
        sensor.capture()
    assert shown == []


def test_depths_that_are_not_numbers_count_as_none(robot, camera, kinematics, joints, world):
    image = camera.capture()
    spoilt = np.array(image.depth)
    spoilt[:100], spoilt[100:120], spoilt[120:140] = np.nan, np.inf, -1.0
    belief = WorldModel(semantic_map(world))
    view = RGBDSensor(Playback(camera, replace(image, depth=spoilt)), kinematics, joints, belief).capture()
    assert (view.image.depth[:140] == 0).all()
    assert np.array_equal(view.image.depth[140:], image.depth[140:])
    empty = Playback(camera, replace(image, depth=np.full_like(image.depth, np.nan)))
    with pytest.raises(CameraError, match="without depth"):
        RGBDSensor(empty, kinematics, joints, belief).capture()


def test_an_image_of_another_size_than_its_intrinsics_is_none(robot, camera, kinematics, joints, world, monkeypatch):
    image = camera.capture()
    monkeypatch.setattr(
        camera, "capture", lambda: RGBDImage(image.rgb[:-1], image.depth, image.intrinsics, image.stamp)
    )
    with pytest.raises(CameraError, match=r"no image: RGBDImage rgb should have shape \(480, 640, 3\)") as error:
        RGBDSensor(camera, kinematics, joints, WorldModel(semantic_map(world)), robot.clock).capture()
    assert (error.value.code, error.value.failure.part) == (CameraErrorCode.NO_IMAGE, camera.name)


@pytest.mark.slow
def test_algorithms_see_a_pinhole_whatever_the_lens_and_the_depth_sensor(robot, model, kinematics, joints, world):
    straight = model.of(CameraPart)["head_camera"]
    exact = replace(straight, noise_base=0.0, noise_quadratic=0.0, dropout=0.0, edge_dropout=0.0, depth_step=0.0)
    lens = replace(exact.intrinsics, distortion=(-0.2, 0.05, 0.001, 0.001))
    wrong = replace(seen_through(exact, lens), depth_scale=1.03, depth_offset=-0.01)
    images = []
    for camera_model in (exact, wrong):
        camera = SimulatedCamera("head_camera", camera_model, np.random.default_rng(3))
        camera.attach(robot.simulation)
        calibrated = replace(model, parts={**model.parts, "head_camera": camera_model})
        known = type(kinematics)(calibrated)
        images.append(RGBDSensor(camera, known, joints, WorldModel(semantic_map(world))).capture().image)
    ideal, seen = images
    assert seen.intrinsics == ideal.intrinsics
    both = (ideal.depth > 0) & (seen.depth > 0)
    assert both.mean() > 0.9 * (ideal.depth > 0).mean()
    difference = np.abs(ideal.depth - seen.depth)[both]
    assert np.median(difference) < 0.001
    assert np.mean(difference < 0.01) > 0.97


def test_an_image_of_the_future_is_none_and_without_a_clock_no_age_is_asked_for(
    robot, camera, kinematics, joints, world
):
    image = camera.capture()
    later = Playback(camera, replace(image, stamp=robot.clock.now() + 0.7))
    belief = WorldModel(semantic_map(world))
    with pytest.raises(CameraError, match=r"0\.70 s in the future") as error:
        RGBDSensor(later, kinematics, joints, belief, robot.clock).capture()
    assert error.value.code is CameraErrorCode.STALE
    assert RGBDSensor(later, kinematics, joints, belief).capture().stamp == later.image.stamp


@pytest.mark.parametrize(("level", "black"), [(8, True), (9, False)])
def test_one_pixel_above_the_level_is_no_black_image(camera, kinematics, joints, world, level, black):
    image = camera.capture()
    rgb = np.zeros_like(image.rgb)
    rgb[100, 200, 1] = level
    sensor = RGBDSensor(Playback(camera, replace(image, rgb=rgb)), kinematics, joints, WorldModel(semantic_map(world)))
    if black:
        with pytest.raises(CameraError, match="black"):
            sensor.capture()
    else:
        assert sensor.capture().image.rgb.max() == level


@pytest.mark.parametrize(("share", "enough"), [(0.0009, False), (0.0011, True)])
def test_a_thousandth_of_the_pixels_must_have_a_depth(camera, kinematics, joints, world, share, enough):
    image = camera.capture()
    depth = np.zeros_like(image.depth)
    depth.ravel()[: round(share * depth.size)] = 1.0
    sensor = RGBDSensor(
        Playback(camera, replace(image, depth=depth)), kinematics, joints, WorldModel(semantic_map(world))
    )
    if enough:
        assert sensor.capture().image.depth.max() == pytest.approx(1.0, abs=0.05)
    else:
        with pytest.raises(CameraError, match="without depth"):
            sensor.capture()
