"""Composing robots from parts: names, overrides, and what is said about bad descriptions."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel, BaseModel
from bestman_bt.robot_model.sensor_parts import LidarPart

TWO_ARMS = """\
base_frame: base_link
parts:
  base: {part: differential_base}
  left: {part: panda_arm, mount: base_link, xyz: [0, 20 cm, 30 cm]}
  left_hand: {part: panda_hand, mount: panda_link8}
  right: {part: panda_arm, mount: base_link, xyz: [0, -20 cm, 30 cm]}
  right_hand: {part: panda_hand, mount: right_panda_link8}
"""


def robot_file(folder: Path, text: str) -> Path:
    path = folder / "robot.yaml"
    path.write_text(text)
    return path


def problems(folder: Path, text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as error:
        load_robot_model(robot_file(folder, text))
    return [f"{problem.line} {problem.field}: {problem.message}" for problem in error.value.problems]


def test_a_second_part_of_a_kind_gets_its_names_prefixed(tmp_path: Path) -> None:
    robot = load_robot_model(robot_file(tmp_path, TWO_ARMS))
    assert robot.of(ArmModel)["left"].joint_names[0] == "panda_joint1"
    assert robot.of(ArmModel)["right"].joint_names[0] == "right_panda_joint1"
    assert robot.hand_of == {"left_hand": "left", "right_hand": "right"}
    assert robot.of(ArmModel)["right"].tool_frame == "right_hand_panda_grasptarget"
    links = [link.get("name") for link in ET.fromstring(robot.urdf).findall("link")]
    assert len(links) == len(set(links))
    assert frozenset(("right_panda_link0", "right_panda_link1")) in robot.allowed_self_pairs
    assert frozenset(("panda_link4", "right_panda_link4")) not in robot.allowed_self_pairs


def test_an_arm_without_a_hand_ends_at_its_tip(tmp_path: Path) -> None:
    text = "".join(line for line in TWO_ARMS.splitlines(keepends=True) if "_hand" not in line)
    robot = load_robot_model(robot_file(tmp_path, text))
    assert robot.of(ArmModel)["left"].tool_frame == "panda_link8"
    assert robot.hand_of == {}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "parts:\n  base: {part: a1_base}\n",
            "2 parts.base: its legs balance by an imu, and the robot has none: mount one on 'trunk'",
        ),
        (
            "parts:\n  arm: {part: xarm6_arm}\n  ring: {part: bumper, mount: link1}\n",
            "3 parts.ring: a bumper lies around the footprint of a base, and the robot has none: leave it out",
        ),
    ],
)
def test_a_part_that_needs_another_one_is_refused_without_it(tmp_path: Path, text: str, fault: str) -> None:
    assert problems(tmp_path, text) == [fault]


def test_an_override_changes_one_field_of_a_part() -> None:
    shipped = load_robot_model("diff_panda")
    changed = load_robot_model("diff_panda", {"parts.lidar.set.beams": 90, "parts.column.xyz": ["10 cm", 0, "30 cm"]})
    assert (shipped.of(LidarPart)["lidar"].beams, changed.of(LidarPart)["lidar"].beams) == (360, 90)
    mount = ET.fromstring(changed.urdf).find("joint[@name='column_mount_joint']/origin")
    np.testing.assert_allclose([float(v) for v in mount.get("xyz").split()], [0.1, 0.0, 0.3])


def test_units_are_converted(tmp_path: Path) -> None:
    text = "base_frame: base_link\nparts:\n  base: {part: differential_base, set: {max_wz: 90 deg/s, track: 480 mm}}\n"
    base = load_robot_model(robot_file(tmp_path, text)).of(BaseModel)["base"].part
    assert (base.max_wz, base.track) == pytest.approx((np.pi / 2, 0.48))


def test_an_unknown_field_is_named_with_its_line_and_the_closest_field(tmp_path: Path) -> None:
    text = TWO_ARMS.replace("mount: panda_link8}", "mounted: panda_link8}")
    assert "5 parts.left_hand.mounted: unknown field; did you mean 'mount'?" in problems(tmp_path, text)


def test_a_wrong_unit_names_the_unit_that_would_be_accepted(tmp_path: Path) -> None:
    text = TWO_ARMS.replace("20 cm, 30 cm", "20 kg, 30 cm", 1)
    assert problems(tmp_path, text) == [
        "4 parts.left.xyz[1]: expected a length in m (m, cm, mm), got '20 kg': 'kg' is a unit of mass"
    ]


def test_a_mount_onto_a_frame_that_does_not_exist_suggests_the_closest_frame(tmp_path: Path) -> None:
    found = problems(tmp_path, TWO_ARMS.replace("mount: panda_link8", "mount: panda_lnk8"))
    assert len(found) == 1
    assert "5 parts.left_hand.mount: no frame 'panda_lnk8' to mount on; did you mean 'panda_link8'?" in found[0]
    assert "base_link" in found[0]


def test_an_unknown_part_suggests_the_closest_one(tmp_path: Path) -> None:
    assert problems(tmp_path, TWO_ARMS.replace("part: panda_arm", "part: pnda_arm", 1)) == [
        "4 parts.left.part: unknown part 'pnda_arm'; did you mean 'panda_arm'?"
    ]


def test_all_problems_of_a_robot_are_reported_at_once(tmp_path: Path) -> None:
    text = TWO_ARMS.replace("30 cm]}", "30 kg]}") + "colour: red\npostures: {home: {left: [0, 0]}}\n"
    assert len(problems(tmp_path, text)) == 4


def test_a_posture_beyond_the_limits_is_refused(tmp_path: Path) -> None:
    text = TWO_ARMS + "postures: {home: {left: [0, 0, 0, 0, 0, 0, 0]}}\n"
    assert problems(tmp_path, text) == [
        "8 postures.home.left[3]: panda_joint4 should be within [-3.0718, -0.0698], got 0"
    ]


def test_a_wrong_quantity_inside_a_part_names_the_parts_file_and_field(tmp_path: Path) -> None:
    part = tmp_path / "post.yaml"
    part.write_text("kind: structure\ngenerated: post\ndimensions:\n  size: [1 cm, 1 cm, 1 cm]\n  mass: 3 m\n")
    text = TWO_ARMS + f"  pole: {{part: {part}, mount: base_link}}\n"
    with pytest.raises(ConfigurationError) as error:
        load_robot_model(robot_file(tmp_path, text))
    (problem,) = error.value.problems
    assert (problem.source, problem.line, problem.field) == (str(part), 5, "dimensions.mass")
    assert "expected a mass in kg (kg, g), got '3 m'" in problem.message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("urdf: pybullet_data:franka_panda/pnda.urdf", "no such file"),
        ("root: panda_linc0", "did you mean 'panda_link0'?"),
        ("cut: [panda_hnd]", "did you mean 'panda_hand'?"),
        ("joints: [panda_joint1]", "should have 1 entries, one per joint, got 7"),
        ("tip: panda_link9", "did you mean 'panda_link8'?"),
        ("generated: post", "one of 'urdf' and 'generated' should be given"),
        ("kind: leg", "unknown kind 'leg'"),
    ],
)
def test_a_faulty_part_is_refused_with_the_remedy(tmp_path: Path, change: str, message: str) -> None:
    text = TWO_ARMS.replace("30 cm]}", f"30 cm], set: {{{change}}}}}", 1)
    found = problems(tmp_path, text)
    assert any(message in problem for problem in found), found
