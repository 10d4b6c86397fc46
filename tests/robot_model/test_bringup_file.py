"""When real arms may be fast: the file that signs a robot's bring-up, and what it has to agree with."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.configuration.data import pybullet_data
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.bringup_file import BringUpFile, Signature, SignedStep, bringup_path, with_bringup_limits
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, RobotModel

SIGNATURE = Signature("somebody", "2026-11-27T10:00:00Z")
ROBOT = """\
base_frame: base_link
parts:
  base: {part: differential_base}
  column: {part: column, mount: base_link, xyz: [15 cm, 0, 30 cm]}
  arm: {part: xarm6_arm, mount: column_top}
connections:
  arm_controller: {driver: xarm, address: 192.168.1.203, parts: [arm]}
"""


@pytest.fixture
def robot_file(tmp_path: Path) -> Path:
    file = tmp_path / "cell.yaml"
    file.write_text(ROBOT)
    return file


def signed_for(model: RobotModel) -> BringUpFile:
    steps = {"limits": SignedStep("passed", SIGNATURE.when, "somebody", "fine", {"arm": {"spare": 0.3}})}
    return BringUpFile("cell", model.content, {"arm_controller": "XI130400000001"}, steps=steps, signed=SIGNATURE)


def share_of_speed(model: RobotModel) -> float:
    full = load_robot_model("diff_xarm6").of(ArmModel)["arm"].velocity
    return float(model.of(ArmModel)["arm"].velocity[0] / full[0])


def test_arms_are_slow_until_the_bring_up_is_signed(robot_file: Path) -> None:
    model = load_robot_model(robot_file)
    slow, why = with_bringup_limits(model)
    assert share_of_speed(slow) == pytest.approx(0.1)
    assert "no bring-up was signed" in why
    file = signed_for(model)
    replace(file, signed=None).write(bringup_path(robot_file))
    slow, why = with_bringup_limits(model)
    assert share_of_speed(slow) == pytest.approx(0.1)
    assert "not signed yet, 1 steps are done" in why
    file.write(bringup_path(robot_file))
    assert BringUpFile.read(bringup_path(robot_file)) == file
    signed, why = with_bringup_limits(model)
    assert (share_of_speed(signed), why) == (1.0, "")
    assert signed.serial_numbers == {"arm_controller": "XI130400000001"}


def test_only_what_a_signed_bring_up_has_measured_counts_as_measured(robot_file: Path) -> None:
    model = load_robot_model(robot_file)
    none = SignedStep("does not apply", SIGNATURE.when, "somebody", "arm: its controller does not report it")
    file = signed_for(model)
    file = replace(file, steps={**file.steps, "mounting": none})
    replace(file, signed=None).write(bringup_path(robot_file))
    assert with_bringup_limits(model)[0].measured == {}
    file.write(bringup_path(robot_file))
    assert with_bringup_limits(model)[0].measured == {"limits": {"arm"}, "mounting": set()}


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("192.168.1.203", "192.168.1.204", True),
        ("base_frame: base_link\n", "base_frame: base_link  # a remark\n", True),
        ("[15 cm, 0, 30 cm]", "[15 cm, 0, 31 cm]", False),
        ("parts: [arm]}", "parts: [arm]}\nsafety: {joint_speed: 0.5}", False),
    ],
)
def test_a_bring_up_of_another_content_of_the_robots_file_is_refused(
    robot_file: Path, old: str, new: str, same: bool
) -> None:
    signed_for(load_robot_model(robot_file)).write(bringup_path(robot_file))
    robot_file.write_text(ROBOT.replace(old, new))
    model = load_robot_model(robot_file)
    if same:
        assert with_bringup_limits(model)[1] == ""
        return
    with pytest.raises(ConfigurationError, match=r"cell\.bringup: content: was signed for another version of cell"):
        with_bringup_limits(model)


def test_settings_of_one_run_make_no_other_robot(robot_file: Path) -> None:
    model = load_robot_model(robot_file)
    run = {"connections.arm_controller.address": "10.0.0.1", "safety.joint_speed": 0.3, "bringup": "elsewhere.bringup"}
    other = load_robot_model(robot_file, run)
    assert other.content == model.content
    assert other.bringup == robot_file.parent / "elsewhere.bringup"
    assert load_robot_model(robot_file, {"parts.column.xyz": ["16 cm", 0, "30 cm"]}).content != model.content


def test_a_bring_up_of_a_twin_counts_for_twins_only(robot_file: Path) -> None:
    model = load_robot_model(robot_file)
    replace(signed_for(model), twin=True).write(bringup_path(robot_file))
    with pytest.raises(ConfigurationError, match="was signed for a twin, and arm_controller is at an address"):
        with_bringup_limits(model)
    twins = {"connections.arm_controller.address": "127.0.0.2"}
    assert with_bringup_limits(load_robot_model(robot_file, twins))[1] == ""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("robot: cell\n", ":1: content: is missing"),
        ("robot: cell\ncontent: a\nsteps: {limits: {outcome: fine}}\n", ":3: steps.limits.outcome"),
        ("robot: [cell\n", "is not YAML"),
    ],
)
def test_a_damaged_file_is_reported_with_its_line(robot_file: Path, text: str, words: str) -> None:
    bringup_path(robot_file).write_text(text)
    with pytest.raises(ConfigurationError) as error:
        with_bringup_limits(load_robot_model(robot_file))
    assert words in str(error.value)


def test_the_bring_up_of_a_shipped_robot_is_the_users(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    models = pybullet_data()
    assert models is not None
    (tmp_path / "bestman-bt").mkdir()
    (tmp_path / "bestman-bt" / "pybullet_data").symlink_to(models)
    monkeypatch.setitem(os.environ, "XDG_DATA_HOME", str(tmp_path))
    model = load_robot_model("diff_xarm6")
    assert model.bringup == tmp_path / "bestman-bt" / "robots" / "diff_xarm6.bringup"
