"""A calibration file changes where parts of a robot are, and says so when it does not fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.sensor_parts import CameraPart

FOUND = """
kind: head
parts:
  head_camera:
    xyz: [0.053, -0.002, 0.001]
    rpy: [0, 0.01, 0]
    set: {distortion: [0.1, 0.0, 0.0, 0.0], depth_scale: 1.01}
"""


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    path = tmp_path / "found.yaml"
    path.write_text(FOUND)
    return path


def test_what_was_found_is_laid_over_the_robot(calibration: Path):
    robot = load_robot_model("diff_panda", {"calibration": [str(calibration)]})
    assert robot.of(CameraPart)["head_camera"].intrinsics.distortion == (0.1, 0.0, 0.0, 0.0)
    assert robot.of(CameraPart)["head_camera"].depth_scale == 1.01
    pose = ForwardKinematics(robot).pose("head_camera_link", {}, "head_tilt_link")
    assert pose.position == pytest.approx(np.array([0.053, -0.002, 0.001]))


def test_settings_of_the_command_line_come_last(calibration: Path):
    settings = {"calibration": [str(calibration)], "parts.head_camera.set.depth_scale": 0.99}
    assert load_robot_model("diff_panda", settings).of(CameraPart)["head_camera"].depth_scale == 0.99


def test_a_robot_file_names_its_calibration_relative_to_itself(calibration: Path, monkeypatch):
    monkeypatch.chdir("/")
    shipped = Path(__file__).parents[2] / "configs" / "robots" / "diff_panda.yaml"
    mine = calibration.with_name("mine.yaml")
    mine.write_text(f"calibration: [{calibration.name}]\n" + shipped.read_text())
    assert load_robot_model(mine).of(CameraPart)["head_camera"].depth_scale == 1.01


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("parts: {head_kamera: {xyz: [0, 0, 0]}}", r"found.yaml:1: parts.head_kamera: .*did you mean 'head_camera'"),
        ("kind: head", "is missing: this file was not written by bestman-bt calibrate"),
        (
            "parts:\n  head_camera:\n    xyz: [0, 0, 3 kg]",
            r"found.yaml:3: parts.head_camera.xyz\[2\]: expected a length",
        ),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_its_line(calibration: Path, text: str, words: str):
    calibration.write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        load_robot_model("diff_panda", {"calibration": [str(calibration)]})


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(ConfigurationError, match="no such calibration file: nowhere.yaml"):
        load_robot_model("diff_panda", {"calibration": ["nowhere.yaml"]})
    with pytest.raises(ConfigurationError, match="should be a list of files"):
        load_robot_model("diff_panda", {"calibration": "nowhere.yaml"})
