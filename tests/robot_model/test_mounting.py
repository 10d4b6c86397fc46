"""Parts go on links or on parts; what cannot be mounted or borne is told before anything connects."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.robot_model.payload import payload

TEN_LINES = """\
parts:
  base: {part: differential_base}
  column: {part: column, mount: base}
  arm: {part: xarm6_arm, mount: column}
  gripper: {part: xarm_gripper, mount: arm}
"""


def composed(folder: Path, text: str):
    path = folder / "robot.yaml"
    path.write_text(text)
    return load_robot_model(path)


def fault(folder: Path, text: str) -> str:
    with pytest.raises(ConfigurationError) as error:
        composed(folder, text)
    return "\n".join(f"{problem.field}: {problem.message}" for problem in error.value.problems)


def test_five_lines_make_a_robot(tmp_path: Path) -> None:
    robot = composed(tmp_path, TEN_LINES)
    assert robot.base_frame == "base_link"
    assert robot.hand_of == {"gripper": "arm"}
    assert robot.of(ArmModel)["arm"].tool_frame == "xarm_tool"
    assert robot.posture("home", robot.of(ArmModel)["arm"].joint_names).tolist() == [0, -0.6, -0.9, 0, 1.5, 0]


def test_to_mount_on_a_part_is_to_mount_on_the_link_that_carries(tmp_path: Path) -> None:
    named = TEN_LINES.replace("mount: column}", "mount: column_top}").replace("mount: arm}", "mount: link6}")
    named = named.replace("mount: base}", "mount: base_link, xyz: [15 cm, 0, 30 cm]}")
    assert composed(tmp_path, named).urdf == composed(tmp_path, TEN_LINES).urdf


def test_what_is_mounted_on_a_turned_deck_is_placed_along_the_axes_of_the_deck(tmp_path: Path) -> None:
    deck = "set: {deck: {link: base_link, xyz: [15 cm, 0, 30 cm], rpy: [0, 0, 90 deg]}}"
    text = TEN_LINES.replace("part: differential_base", f"part: differential_base, {deck}")
    robot = composed(tmp_path, text.replace("mount: base}", "mount: base, xyz: [10 cm, 0, 5 cm]}"))
    joint = ET.fromstring(robot.urdf).find("joint[@name='column_mount_joint']/origin")
    assert joint is not None
    numbers = [float(number) for key in ("xyz", "rpy") for number in joint.get(key, "").split()]
    assert numbers == pytest.approx([0.15, 0.10, 0.35, 0.0, 0.0, math.pi / 2])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("mount: column}", "mount: colum}"), "parts.arm.mount: no frame 'colum' to mount on; did you mean 'column'"),
        (("mount: arm}", "mount: left_wheel}"), "'left_wheel' turns with the joint 'left_wheel_joint' of a wheel"),
        (("xarm6_arm, mount: column}", "differential_base, mount: column}"), "a base stands on the floor"),
        (("part: xarm6_arm", "part: xarm6"), "parts.arm.part: unknown part 'xarm6'; did you mean 'xarm6_arm'?"),
        (("  arm: {", "  column: {"), "parts.column: is given twice"),
        (
            ("gripper: {part: xarm_gripper, mount: arm}", "head: {part: pan_tilt, mount: gripper}"),
            "no frame 'gripper' to mount on",
        ),
    ],
)
def test_impossible_mounts_and_parts_are_reported_with_their_remedy(tmp_path: Path, change, words) -> None:
    assert words in fault(tmp_path, TEN_LINES.replace(*change))


def test_a_part_that_carries_nothing_names_the_links_to_choose_from(tmp_path: Path) -> None:
    text = TEN_LINES + "  camera: {part: wrist_camera, mount: gripper}\n"
    words = fault(tmp_path, text)
    assert "the gripper 'gripper' does not say where it carries something: name a link of it" in words
    assert "xarm_gripper_base_link" in words


def test_an_arm_refuses_more_than_its_payload(tmp_path: Path) -> None:
    heavy = "{part: wsg50, mount: arm, set: {dimensions: {housing_mass: 6 kg}}}"
    text = TEN_LINES.replace("{part: xarm_gripper, mount: arm}", heavy)
    assert fault(tmp_path, text) == "parts.arm: 6.2 kg are mounted on it, more than its payload of 5 kg"


def test_what_hangs_on_the_tip_counts_but_not_the_arm_itself(tmp_path: Path) -> None:
    robot = composed(tmp_path, TEN_LINES)
    hand = payload(robot, "xarm_gripper_base_link").mass
    assert 0.5 < hand < 1.0
    assert payload(robot, "link6").mass == pytest.approx(hand + 0.1096)


def test_the_centre_of_what_hangs_on_a_link_turns_with_what_lies_between() -> None:
    urdf = """<robot name="r"><link name="tip"/>
      <link name="hand"><inertial><origin xyz="0.5 0 0"/><mass value="2"/></inertial></link>
      <joint name="wrist" type="revolute"><parent link="tip"/><child link="hand"/><origin xyz="1 0 0" rpy="0 0 %s"/>
      <axis xyz="0 0 1"/></joint></robot>"""
    for mounted, turned in ((math.pi / 2, 0.0), (0.0, math.pi / 2)):
        hung = payload(SimpleNamespace(urdf=urdf % mounted), "tip", {"wrist": turned})
        assert (hung.mass, *hung.centre) == pytest.approx((2.0, 1.0, 0.5, 0.0))


def test_a_base_refuses_more_than_its_payload(tmp_path: Path) -> None:
    text = TEN_LINES.replace("mount: base}", "mount: base, set: {dimensions: {mass: 90 kg}}}")
    assert "more than its payload of 80 kg" in fault(tmp_path, text)


def test_a_seat_is_where_the_root_of_a_part_lies_on_what_carries_it(tmp_path: Path) -> None:
    """The Allegro hand's root is 95 mm ahead of where its palm begins."""
    text = TEN_LINES.replace("{part: xarm_gripper, mount: arm}", "{part: allegro_hand, mount: arm, xyz: [0, 0, 1 cm]}")
    robot = composed(tmp_path, text)
    joints = {joint.get("name"): joint for joint in ET.fromstring(robot.urdf).findall("joint")}
    assert joints["gripper_mount_joint"].find("origin").get("xyz") == "0.0093 0 0.105"
    assert robot.of(ArmModel)["arm"].tool_frame == "allegro_tool"


def test_a_misspelt_part_to_mount_on_is_reported_beside_the_part_that_cannot_be_read(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(
        "parts:\n  trunk: {part: colum}\n  arm: {part: panda_arm, mount: trunkk}\n"
        "  hand: {part: panda_hand, mount: trunk_top}\n"
    )
    with pytest.raises(ConfigurationError) as raised:
        load_robot_model(file)
    told = str(raised.value)
    assert "robot.yaml:2: parts.trunk.part: unknown part 'colum'; did you mean 'column'?" in told
    assert "robot.yaml:3: parts.arm.mount: no part 'trunkk' to mount on; did you mean 'trunk'?" in told
    assert "trunk_top" not in told, "it may be a frame of the part that could not be read"
