"""Connections and safety limits of a robot's YAML: what is wrong is told before anything connects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.configuration import ConfigurationError, Document
from bestman_bt.robot_model import RobotModel, compose_robot

PARTS = {
    "base": {"part": "differential_base"},
    "column": {"part": "column", "mount": "base_link"},
    "arm": {"part": "xarm6_arm", "mount": "column_top"},
    "gripper": {"part": "xarm_gripper", "mount": "link6"},
}
XARM = {"driver": "xarm", "address": "10.11.12.13", "token": "secret", "parts": ["arm", "gripper"]}


def robot(**fields: Any) -> RobotModel:
    data = {"base_frame": "base_link", "parts": PARTS, **fields}
    return compose_robot("my_robot", Document(data, {(): ("my_robot.yaml", 1)}))


def test_connections_are_in_the_model_with_the_drivers_own_options() -> None:
    model = robot(connections={"controller": {**XARM, "options": {"rate": "50 Hz", "payload": "800 g"}}})
    connection = model.connections["controller"]
    assert connection.parts == ("arm", "gripper")
    assert connection.options.rate == 50.0
    assert connection.options.payload == pytest.approx(0.8)


def test_addresses_and_tokens_are_in_no_text() -> None:
    model = robot(connections={"controller": XARM})
    assert model.connections["controller"].address == "10.11.12.13"
    for text in (repr(model), str(model.connections), repr(model.connections["controller"])):
        assert "10.11.12.13" not in text
        assert "secret" not in text


def test_safety_makes_arms_slower_and_grippers_weaker_in_the_model() -> None:
    plain = robot()
    safe = robot(safety={"joint_speed": 0.5, "gripper_force": "15 N", "base_speed": "20 cm/s", "base_turn": 9})
    assert safe.arms["arm"].velocity == pytest.approx(plain.arms["arm"].velocity / 2)
    assert np.all(safe.arms["arm"].acceleration == plain.arms["arm"].acceleration)
    assert safe.grippers["gripper"].max_force == 15.0
    assert safe.bases["base"].max_vx == 0.2
    assert safe.bases["base"].max_wz == plain.bases["base"].max_wz


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"connections": {"c": {**XARM, "driver": "xram"}}}, ["connections.c.driver", "did you mean 'xarm'"]),
        ({"connections": {"c": {**XARM, "parts": []}}}, ["connections.c.parts", "at least one part"]),
        ({"connections": {"c": {**XARM, "parts": ["arn"]}}}, ["connections.c.parts[0]", "did you mean 'arm'"]),
        ({"connections": {"c": XARM, "d": XARM}}, ["connections.d.parts[0]", "behind connection 'c' already"]),
        ({"connections": {"c": {**XARM, "adress": "x"}}}, ["connections.c.adress", "did you mean 'address'"]),
        ({"connections": {"c": {**XARM, "options": {"rate": "2 kg"}}}}, ["connections.c.options.rate", "Hz"]),
        ({"connections": {"c": {**XARM, "options": {"speed": 1}}}}, ["connections.c.options.speed", "unknown field"]),
        ({"connections": {"c": {**XARM, "options": {"collision_sensitivity": 9}}}}, ["collision_sensitivity", "5"]),
        ({"safety": {"joint_speed": 1.5}}, ["safety.joint_speed", "1"]),
        ({"safety": {"joint_speed": 0}}, ["safety.joint_speed", "above 0"]),
        ({"safety": {"tool_speed": "3 N"}}, ["safety.tool_speed", "m/s", "'N' is a unit of force"]),
        ({"safety": {"watchdog": 0}}, ["safety.watchdog"]),
        (
            {"safety": {"workspace": {"lower": [0, 0, 1], "upper": [1, 1, 1]}}},
            ["safety.workspace", "lower z = 1 m should be below upper z = 1 m"],
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_field(fields: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(ConfigurationError) as error:
        robot(**fields)
    for word in words:
        assert word in str(error.value)
    assert "10.11.12.13" not in str(error.value)


def test_all_faults_are_told_at_once() -> None:
    with pytest.raises(ConfigurationError) as error:
        robot(connections={"c": {**XARM, "driver": "ru", "parts": ["leg"]}}, safety={"joint_speed": 0})
    assert len(error.value.problems) == 3


def test_the_shipped_robots_need_no_connection(tmp_path: Path) -> None:
    assert robot().connections == {}
