"""Cameras in robot files: lens, calibrated intrinsics, systematic depth error."""

from __future__ import annotations

import math

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import CameraIntrinsics
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.sensor_parts import CameraPart

SET = "parts.head_camera.set"


def test_without_calibration_a_camera_is_an_ideal_pinhole():
    camera = load_robot_model("diff_panda").of(CameraPart)["head_camera"]
    assert camera.intrinsics.distortion == ()
    assert (camera.depth_scale, camera.depth_offset, camera.depth_step) == (1.0, 0.0, 0.001)
    assert camera.intrinsics.fy == pytest.approx(240 / math.tan(math.radians(29)))


def test_a_calibrated_camera_has_the_lens_and_the_depth_that_its_file_says():
    settings = {
        f"{SET}.focal_length": [431.5, 432.5],
        f"{SET}.principal_point": [322.1, 238.4],
        f"{SET}.distortion": [-0.2, 0.05, 0.001, -0.001, 0.0],
        f"{SET}.depth_scale": 1.01,
        f"{SET}.depth_offset": "-3 mm",
    }
    camera = load_robot_model("diff_panda", settings).of(CameraPart)["head_camera"]
    lens = (-0.2, 0.05, 0.001, -0.001, 0.0)
    assert camera.intrinsics == CameraIntrinsics(640, 480, 431.5, 432.5, 322.1, 238.4, lens)
    assert (camera.depth_scale, camera.depth_offset) == (1.01, -0.003)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("distortion", [0.1, 0.2], r"distortion: should be k1, k2, p1, p2 and optionally k3, or empty, got 2 numbers"),
        ("distortion", [0.1, 0.2, 0, "2 cm"], r"distortion\[3\]: expected a number without a unit"),
        ("focal_length", [0, 400], r"focal_length\[0\]: should be greater than 0"),
        ("depth_scale", -1, "depth_scale: should be greater than 0"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(field, value, words):
    with pytest.raises(ConfigurationError, match=words):
        load_robot_model("diff_panda", {f"{SET}.{field}": value})
