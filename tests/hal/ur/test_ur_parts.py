"""Parts that a UR or a Robotiq controller cannot have behind it are refused before anything connects."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import load_robot_model

ROBOT = Path(__file__).parent / "ur5e_on_a_base.yaml"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"connections.arm_controller.parts": ["arm", "base"]}, "'base' is of the kind base; .* 'ur' can be: arm"),
        ({"connections.arm_controller.parts": ["wrist_force_torque"]}, "should name 1 of the kind arm, names 0"),
        ({"connections.hand_controller.parts": ["base"]}, "'base' is of the kind base; .* 'robotiq' can be: gripper"),
    ],
)
def test_a_part_of_another_kind_is_refused(change: dict[str, list[str]], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        load_robot_model(ROBOT, change)


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
