"""Parts that a UR or a Robotiq controller cannot have behind it are refused before anything connects."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration import ConfigurationError
from bestman_bt.robot_model import load_robot_model
from hal.hardware import ConnectionFailedError, HardwareRobot

pytestmark = pytest.mark.real_time

ROBOT = Path(__file__).parent / "ur5_on_a_base.yaml"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"connections.arm_controller.parts": ["arm", "base"]}, "a UR has one arm"),
        ({"connections.arm_controller.parts": ["wrist_force_torque"]}, "a UR has one arm"),
        ({"connections.hand_controller.parts": ["gripper", "base"]}, "is one gripper"),
    ],
)
def test_a_part_of_another_kind_is_refused(change: dict[str, list[str]], words: str) -> None:
    with pytest.raises(ConnectionFailedError, match=words):
        HardwareRobot(load_robot_model(ROBOT, change))


@pytest.mark.parametrize(
    "options",
    [
        {"arm_controller": {"rate": 1000}},
        {"arm_controller": {"servo_lookahead": 0.5}},
        {"arm_controller": {"gain": 300}},
        {"hand_controller": {"protocol": "rs485"}},
        {"hand_controller": {"open_position": 300}},
    ],
)
def test_options_beyond_what_the_vendor_takes_are_refused_when_the_file_is_read(
    options: dict[str, dict[str, object]],
) -> None:
    changes = {f"connections.{name}.options": given for name, given in options.items()}
    with pytest.raises(ConfigurationError, match="options"):
        load_robot_model(ROBOT, changes)
