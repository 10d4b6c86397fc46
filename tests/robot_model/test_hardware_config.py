"""Connections and safety limits of a robot's YAML: what is wrong is told before anything connects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.hardware_config import with_first_limits
from bestman_bt.robot_model.model import ArmModel, BaseModel, GripperModel, RobotModel

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
    safe = robot(safety={"joint_speed": 0.5, "gripper_force": "15 N", "base_speed": "20 cm/s", "base_turn": "9 rad/s"})
    assert safe.of(ArmModel)["arm"].velocity == pytest.approx(plain.of(ArmModel)["arm"].velocity / 2)
    assert np.all(safe.of(ArmModel)["arm"].acceleration == plain.of(ArmModel)["arm"].acceleration)
    assert safe.of(GripperModel)["gripper"].part.max_force == 15.0
    assert safe.of(BaseModel)["base"].part.max_vx == 0.2
    assert safe.of(BaseModel)["base"].part.max_wz == plain.of(BaseModel)["base"].part.max_wz


def test_safety_holds_for_every_arm_base_and_hand_and_makes_none_faster() -> None:
    second = {
        "arm_2": {"part": "ur5_arm", "mount": "column_top", "xyz": [0.1, 0.4, 0]},
        "hand_2": {"part": "wsg50", "mount": "arm_2"},
    }
    parts = {**PARTS, **second, "base": {"part": "omni_base"}}
    plain = robot(parts=parts)
    safe = robot(
        parts=parts,
        safety={"joint_speed": 0.25, "gripper_force": "12 N", "base_speed": "0.1 m/s", "base_turn": "0.3 rad/s"},
    )
    for name, arm in plain.of(ArmModel).items():
        assert np.allclose(safe.of(ArmModel)[name].velocity, arm.velocity / 4)
        with pytest.raises(ValueError, match="read-only"):
            safe.of(ArmModel)[name].velocity[0] = 9.0
        assert np.all(safe.of(ArmModel)[name].upper == arm.upper)
    assert [hand.part.max_force for hand in safe.of(GripperModel).values()] == [12.0, 12.0]
    base = safe.of(BaseModel)["base"].part
    assert (base.max_vx, base.max_vy, base.max_wz) == (0.1, 0.1, 0.3)
    assert (safe.safety.joint_speed, safe.safety.base_speed) == (0.25, 0.1)
    fast = robot(parts=parts, safety={"gripper_force": "1 kN", "base_speed": "9 m/s", "base_turn": "9 rad/s"})
    assert fast.of(BaseModel)["base"].part.max_vx == plain.of(BaseModel)["base"].part.max_vx == 0.6
    assert (fast.of(BaseModel)["base"].part.max_vy, fast.of(BaseModel)["base"].part.max_wz) == (0.6, 1.2)
    for name, hand in plain.of(GripperModel).items():
        assert fast.of(GripperModel)[name].part.max_force == hand.part.max_force


def test_an_address_and_a_token_may_be_what_the_environment_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARM_ADDRESS", "10.9.9.9")
    monkeypatch.delenv("ARM_TOKEN", raising=False)
    named = robot(connections={"c": {**XARM, "address": "${ARM_ADDRESS}", "token": "${ARM_TOKEN}"}}).connections["c"]
    assert (named.address, named.token) == ("10.9.9.9", "")
    plain = robot(connections={"c": {**XARM, "address": "ARM_ADDRESS", "token": "x${ARM_ADDRESS}"}}).connections["c"]
    assert (plain.address, plain.token) == ("ARM_ADDRESS", "x${ARM_ADDRESS}")


def test_a_load_up_to_what_the_arm_may_carry_is_taken() -> None:
    def loaded(payload: str) -> RobotModel:
        return robot(connections={"c": {**XARM, "options": {"payload": payload}}})

    assert loaded("5 kg").connections["c"].options.payload == 5.0
    with pytest.raises(ConfigurationError, match="connections.c.options.payload: 5.01 kg is more than 'arm' may carry"):
        loaded("5.01 kg")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"connections": {"c": {**XARM, "parts": ["arm", "arm"]}}}, ["connections.c.parts[1]", "'c' already"]),
        ({"connections": {"c": {**XARM, "parts": ["gripper"]}}}, ["should name 1 of the kind arm, names 0"]),
        (
            {"connections": {"c": {**XARM, "parts": ["arm", "base"]}}},
            ["connections.c.parts[1]", "'base' is of the kind"],
        ),
        (
            {"safety": {"workspace": {"lower": ["1.1 m", 0, 0], "upper": ["1 m"] * 3}}},
            ["lower x = 1.1 m should be below"],
        ),
        ({"safety": {"base_speed": "-1 m/s"}}, ["safety.base_speed"]),
        ({"safety": {"base_turn": "-1 rad/s"}}, ["safety.base_turn"]),
        ({"safety": {"gripper_force": "-1 N"}}, ["safety.gripper_force"]),
        ({"connections": {"c": {**XARM, "driver": "xram"}}}, ["connections.c.driver", "did you mean 'xarm'"]),
        ({"connections": {"c": {**XARM, "parts": []}}}, ["connections.c.parts", "at least one part"]),
        ({"connections": {"c": {**XARM, "parts": ["arn"]}}}, ["connections.c.parts[0]", "did you mean 'arm'"]),
        ({"connections": {"c": XARM, "d": XARM}}, ["connections.d.parts[0]", "behind connection 'c' already"]),
        ({"connections": {"c": {**XARM, "adress": "x"}}}, ["connections.c.adress", "did you mean 'address'"]),
        ({"connections": {"c": {**XARM, "options": {"rate": "2 kg"}}}}, ["connections.c.options.rate", "Hz"]),
        ({"connections": {"c": {**XARM, "options": {"speed": 1}}}}, ["connections.c.options.speed", "unknown field"]),
        ({"connections": {"c": {**XARM, "options": {"collision_sensitivity": 9}}}}, ["collision_sensitivity", "5"]),
        ({"safety": {"joint_speed": 1.5}}, ["safety.joint_speed", "1"]),
        (
            {"safety": dict.fromkeys(("joint_speed", "tool_speed", "base_speed", "base_turn", "gripper_force"), 0)},
            [
                f"safety.{limit}: should be greater than 0, got 0"
                for limit in ("joint_speed", "tool_speed", "base_speed", "base_turn", "gripper_force")
            ],
        ),
        ({"safety": {"tool_speed": "3 N"}}, ["safety.tool_speed", "m/s", "'N' is a unit of force"]),
        ({"safety": {"watchdog": 0}}, ["safety.watchdog"]),
        ({"safety": {"base_turn": 90}}, ["safety.base_turn: needs its unit: '90 rad/s' or '90 deg/s', got 90"]),
        ({"safety": {"watchdog": 250}}, ["safety.watchdog: needs its unit: '250 s' or '250 ms'"]),
        (
            {"safety": {"workspace": {"lower": [0, 0, "1 m"], "upper": ["1 m"] * 3}}},
            ["safety.workspace", "lower z = 1 m should be below upper z = 1 m"],
        ),
    ],
)
def test_what_is_wrong_is_reported_with_its_field(fields: dict[str, Any], words: list[str]) -> None:
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


@pytest.mark.parametrize(
    ("safety", "share", "tool_speed"),
    [
        ({}, 0.1, 0.25),
        ({"watchdog": "0.5 s", "base_speed": "0.2 m/s"}, 0.1, 0.25),
        ({"joint_speed": 1.0}, 0.1, 0.25),
        ({"joint_speed": 0.05}, 0.05, 0.25),
        ({"tool_speed": "0.1 m/s"}, 0.1, 0.1),
    ],
)
def test_first_motions_of_real_arms_are_slow_whatever_their_file_allows(
    safety: dict[str, Any], share: float, tool_speed: float
) -> None:
    plain, model = robot(), with_first_limits(robot(safety=safety))
    assert model.of(ArmModel)["arm"].velocity == pytest.approx(share * plain.of(ArmModel)["arm"].velocity)
    assert (model.safety.joint_speed, model.safety.tool_speed) == (share, tool_speed)
    assert model.safety.watchdog == (0.5 if "watchdog" in safety else 0.25)
    usual = plain.of(BaseModel)["base"].part.max_vx
    assert model.of(BaseModel)["base"].part.max_vx == (0.2 if "base_speed" in safety else usual)


@pytest.mark.parametrize(
    ("field", "value", "unit", "joint"),
    [
        ("velocity", [3.2, 3, 3, 3, 3, 3], "rad/s", "joint1"),
        ("upper", [1, 1, -0.2, 1, 1, 7], "rad", "joint6"),
        ("lower", [-7, -1, -1, -1, -1, -1], "rad", "joint1"),
        ("acceleration", [1, 1, 21, 1, 1, 1], "rad/s²", "joint3"),
    ],
)
def test_limits_of_a_real_arm_beyond_those_of_its_part_are_reported(
    field: str, value: list[float], unit: str, joint: str
) -> None:
    arm = {**PARTS["arm"], "set": {"limits": {field: [f"{one} {unit}" for one in value]}}}
    robot(parts={**PARTS, "arm": arm})  # in simulation anything goes
    with pytest.raises(ConfigurationError) as error:
        robot(parts={**PARTS, "arm": arm}, connections={"controller": XARM})
    (problem,) = error.value.problems
    assert problem.field == f"parts.arm.set.limits.{field}"
    assert f"{joint} = " in problem.message
    arm["set"]["limits"][field] = [f"{min(max(one, -1), 3) if unit == 'rad' else 0.9} {unit}" for one in value]
    assert robot(parts={**PARTS, "arm": arm}, connections={"controller": XARM}).connections
