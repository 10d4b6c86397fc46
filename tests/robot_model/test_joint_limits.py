"""The URDF that planners and physics read has the limits of the descriptions, and no others."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml

from bestman_bt.configuration.document import Document
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.robot_model.compose import combine, compose_robot, load_robot_model
from bestman_bt.robot_model.model import ArmModel, GripperModel, RobotModel
from bestman_bt.robot_model.payload import payload

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return combine("omni_base", "xarm6_arm", "robotiq_2f85")


def limits_of(robot: RobotModel, joint: str) -> tuple[float | None, float | None, float, float]:
    """Lower, upper (None: none), velocity, effort."""
    found = next(one for one in ET.fromstring(robot.urdf).findall("joint") if one.get("name") == joint)
    limit = found.find("limit")
    assert limit is not None
    ends = [float(limit.get(name)) if limit.get(name) is not None else None for name in ("lower", "upper")]
    assert (found.get("type") == "continuous") is (ends == [None, None])
    return ends[0], ends[1], float(limit.get("velocity")), float(limit.get("effort"))


def test_an_arms_joints_have_the_limits_of_its_description(robot: RobotModel) -> None:
    arm = robot.of(ArmModel)["arm"]
    found = np.array([limits_of(robot, joint) for joint in arm.joint_names], float)
    np.testing.assert_allclose(found, np.stack([arm.lower, arm.upper, arm.velocity, arm.effort], axis=1), rtol=1e-8)


@pytest.mark.parametrize("arm", ["kinova_arm", "iiwa_arm"])
def test_a_joint_that_turns_for_ever_in_its_source_turns_as_far_as_its_cables_let_it(arm: str) -> None:
    robot = combine("differential_base", arm, "wsg50")
    model = robot.of(ArmModel)["arm"]
    for joint, lower, upper in zip(model.joint_names, model.lower, model.upper, strict=True):
        assert limits_of(robot, joint)[:2] == pytest.approx((lower, upper))


def test_wheels_turn_as_fast_as_the_base_drives_and_turns_at_once(robot: RobotModel) -> None:
    wheel = limits_of(robot, "front_left_wheel_joint")
    assert wheel == (None, None, pytest.approx((0.6 + 1.2 * 0.42 / 2) / 0.08), 25.0)
    assert limits_of(robot, "rear_right_steering_joint") == (None, None, 6.0, 40.0)


def test_fingers_that_slide_share_width_speed_and_have_the_force_of_the_hand() -> None:
    robot = combine("differential_base", "xarm6_arm", "panda_hand")
    hand = robot.of(GripperModel)["gripper"]
    for joint in hand.part.joints:
        expected = (hand.part.min_width / 2, hand.max_width / 2, hand.part.max_speed / 2, hand.part.max_force)
        assert limits_of(robot, joint) == pytest.approx(expected)


def test_fingers_on_a_linkage_are_as_fast_and_strong_as_the_hand_everywhere(robot: RobotModel) -> None:
    hand = robot.of(GripperModel)["gripper"]
    lower, upper, velocity, effort = limits_of(robot, hand.part.joints[0])
    assert (lower, upper) == pytest.approx(hand.joint_range)
    steps = np.abs(np.diff(np.array(hand.opening), axis=0))
    per_metre = steps[:, 0] / steps[:, 1]
    assert velocity == pytest.approx(per_metre.max() * hand.part.max_speed, rel=1e-6)
    assert effort == pytest.approx(hand.part.max_force / (len(hand.part.joints) * per_metre.min()), rel=1e-6)
    for follower in hand.followers:
        ends = sorted(hand.joint_positions(width)[follower.joint] for width in (hand.part.min_width, hand.max_width))
        assert limits_of(robot, follower.joint)[:2] == pytest.approx((ends[0] - 0.1, ends[1] + 0.1), abs=1e-6)


@pytest.mark.parametrize("name", ["robotiq_2f85", "panda_hand", "xarm_gripper", "pr2_gripper"])
def test_the_width_of_a_hand_and_its_joints_say_the_same(name: str) -> None:
    hand = combine("differential_base", "xarm6_arm", name).of(GripperModel)["gripper"]
    low, high = hand.joint_range
    widths = np.linspace(hand.part.min_width, hand.max_width, 7)
    for width in widths:
        positions = hand.joint_positions(width)
        driven = [positions[joint] for joint in hand.part.joints]
        assert hand.width(driven) == pytest.approx(width, abs=1e-4)
        assert all(low - 1e-9 <= position <= high + 1e-9 for position in driven)
        for mimic in hand.followers:
            assert positions[mimic.joint] == pytest.approx(mimic.multiplier * positions[mimic.leader] + mimic.offset)
    slopes = [hand.transmission(width) for width in (widths[:-1] + widths[1:]) / 2]
    for slope, (before, after) in zip(slopes, pairwise(widths), strict=True):
        one, two = (hand.joint_positions(width)[hand.part.joints[0]] for width in (before, after))
        assert slope == pytest.approx(abs(two - one) / (after - before), rel=0.1)
    assert hand.fastest_transmission >= max(slopes) - 1e-9


CHAIN = """<robot name="r"><link name="root"><inertial><mass value="1"/></inertial></link>
<link name="a"><inertial><origin xyz="0.5 0 0"/><mass value="2"/></inertial></link>
<link name="frame"/>
<link name="b"><inertial><origin xyz="0 0.5 0"/><mass value="6"/></inertial></link>
<joint name="turn" type="revolute"><parent link="root"/><child link="a"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
</joint>
<joint name="fix" type="fixed"><parent link="a"/><child link="frame"/><origin xyz="0 0 2"/></joint>
<joint name="slide" type="prismatic"><parent link="frame"/><child link="b"/><axis xyz="0 0 1"/></joint></robot>"""


def test_what_a_link_carries_is_weighed_where_its_joints_have_it(robot: RobotModel) -> None:
    model = RobotModel("r", CHAIN, "root")
    assert payload(model, "root").mass == 9.0
    assert payload(model, "a").mass == 8.0
    assert payload(model, "a").centre == pytest.approx([0.125, 0.375, 1.5])
    turned = payload(model, "root", {"turn": np.pi / 2, "slide": 0.5})
    assert turned.centre == pytest.approx(np.array([8 - 3.0, 1.0, 12 + 3.0]) / 9)
    assert payload(model, "frame", {"turn": 1.0}).centre == pytest.approx([0.0, 0.5, 0.0])
    assert payload(model, "nowhere").mass == 0.0


@pytest.mark.parametrize(("mass", "refused"), [(4.99, False), (5.01, True)])
def test_an_arm_takes_what_is_just_within_its_payload(mass: float, refused: bool) -> None:
    light = combine("differential_base", "xarm6_arm", "wsg50")
    hand = payload(light, "link6").mass - 0.1096
    housing = {"set": {"dimensions": {"housing_mass": mass - hand + 1.2}}}
    parts = {
        "base": {"part": "differential_base"},
        "column": {"part": "column", "mount": "base"},
        "arm": {"part": "xarm6_arm", "mount": "column"},
        "gripper": {"part": "wsg50", "mount": "arm", **housing},
    }
    assert hand == pytest.approx(1.4, abs=1.0)
    document = Document({"parts": parts})
    if refused:
        with pytest.raises(ValueError, match="are mounted on it, more than its payload of 5 kg"):
            compose_robot("r", document)
    else:
        assert compose_robot("r", document).of(ArmModel)


TOLERANT = """parts:
  base: {part: differential_base}
  column: {part: column, mount: base}
  arm: {part: panda_arm, mount: column, set: {constraints: CONSTRAINTS}}
  other: {part: panda_arm, mount: column, xyz: [0, 50 cm, 0], set: {constraints: CONSTRAINTS}}
"""


def test_tolerances_are_the_parts_and_those_of_single_joints_also_of_two_equal_arms(tmp_path: Path) -> None:
    text = re.search(r"constraints:\n(.*?)```", (DOCS / "robots.md").read_text(), re.DOTALL)
    assert text is not None
    for arm in _tolerant(tmp_path, str(yaml.safe_load(text[1]))).of(ArmModel).values():
        assert arm.path_tolerance == pytest.approx([0.15] * 6 + [0.3])
        assert arm.goal_tolerance == pytest.approx([0.005] * 6 + [0.01])
        assert (arm.part.constraints.goal_time, arm.part.constraints.stopped_velocity) == (2.0, 0.03)


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("{trajectory: 0.1}", "constraints.trajectory: needs its unit"),
        ("{goal: 0 rad}", "constraints.goal: should be greater than 0"),
        ("{goal_time: -1 s}", "constraints.goal_time: should be greater than 0"),
        ("{goal: 3 kg}", "constraints.goal: expected an angle in rad"),
        ("{joints: {panda_joint9: {goal: 1 deg}}}", "the part has no joint 'panda_joint9'; did you mean 'panda_joint"),
        ("{joints: {panda_joint7: {gaol: 1 deg}}}", "constraints.joints.panda_joint7.gaol"),
    ],
)
def test_a_wrong_tolerance_is_reported_with_its_line(tmp_path: Path, written: str, told: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        _tolerant(tmp_path, written)
    assert any(f"robot.yaml:{line}: " in str(error.value) for line in (4, 5))
    assert told in str(error.value)


def _tolerant(folder: Path, constraints: str) -> RobotModel:
    path = folder / "robot.yaml"
    path.write_text(TOLERANT.replace("CONSTRAINTS", constraints))
    return load_robot_model(path)
