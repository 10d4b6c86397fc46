"""Any URDF is a part: its kind, joints, limits, tool frame and states are found out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.quantity import parse_quantity
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import BaseModel, GripperModel
from bestman_bt.robot_model.urdf_source import UrdfError, locate_urdf, read_srdf
from bestman_bt.runtime.part_import import ImportedPart, PartRequest, import_part
from tests.robot_model.small_robot import JOINTS, SRDF, arm_urdf, written


def imported(path: Path, srdf: Path | None = None, **request) -> tuple[ImportedPart, dict]:
    part = import_part(path, PartRequest("small", **request), None if srdf is None else read_srdf(srdf))
    return part, yaml.safe_load(part.description)


def shipped(source: str) -> Path:
    return locate_urdf(source, Path())


def test_a_chain_of_joints_is_an_arm_up_to_its_hand(tmp_path: Path) -> None:
    part, fields = imported(written(tmp_path, arm_urdf()))
    assert part.kind == "arm"
    assert (fields["root"], fields["tip"], fields["cut"]) == ("foot", "l5", ["palm"])
    assert fields["joints"] == list(JOINTS)
    assert fields["limits"]["upper"] == ["2.5 rad"] * 5
    assert fields["limits"]["velocity"] == ["2.0 rad/s"] * 5
    assert any("accelerations" in note for note in part.notes)


def test_an_srdf_brings_states_and_pairs_and_leaves_out_what_cannot_be(tmp_path: Path) -> None:
    srdf = written(tmp_path, SRDF, "small.srdf")
    part, fields = imported(written(tmp_path, arm_urdf()), srdf, group="arm")
    assert fields["states"] == {"ready": [0.0, 0.5, 0.0, 1.0, 0.0]}
    assert fields["may_touch"] == [["foot", "l2"]]
    assert any("'impossible'" in note for note in part.notes)
    assert part.robot.posture("ready", JOINTS).tolist() == [0.0, 0.5, 0.0, 1.0, 0.0]


def test_the_hand_of_the_same_file_gets_a_tool_between_its_fingers(tmp_path: Path) -> None:
    part, fields = imported(written(tmp_path, arm_urdf()), written(tmp_path, SRDF, "small.srdf"), group="hand")
    assert part.kind == "gripper"
    assert parse_quantity(fields["max_width"], "length") == pytest.approx(0.06)
    assert sorted(fields["finger_links"]) == ["left_finger", "right_finger"]
    tool = fields["frames"]["tool"]
    assert (tool["link"], tool["xyz"][:2]) == ("palm", [0.0, 0.0])
    assert 0.04 < tool["xyz"][2] < 0.1  # between the beginning and the end of the fingers
    gripper = part.robot.of(GripperModel)["small"]
    assert gripper.joint_positions(0.06) == pytest.approx({"left_joint": 0.03, "right_joint": 0.03})


def test_an_imported_hand_has_the_widths_of_the_one_that_was_described_by_hand() -> None:
    part, _ = imported(shipped("pybullet_data:franka_panda/panda.urdf"), kind="gripper", cut=())
    ours = load_robot_model("diff_panda").of(GripperModel)["gripper"]
    assert part.robot.of(GripperModel)["small"].max_width == pytest.approx(ours.max_width, abs=1e-4)


def test_four_wheels_that_turn_without_end_are_a_skid_base() -> None:
    part, fields = imported(shipped("pybullet_data:husky/husky.urdf"), cut=("imu_link",))
    ours = load_robot_model("husky_panda").of(BaseModel)["base"]
    assert fields["wheel_joints"] == list(ours.part.wheel_joints)
    assert (fields["wheel_radius"], fields["track"]) == pytest.approx((ours.part.wheel_radius, ours.part.track))
    places, told = np.array(part.robot.of(BaseModel)["small"].wheel_places), np.array(ours.wheel_places)
    # Ours are told from the centre that the loaded base turns about.
    np.testing.assert_allclose(places - places.mean(axis=0), told - told.mean(axis=0), atol=1e-6)


def test_links_that_overlap_by_construction_need_no_check(tmp_path: Path) -> None:
    fat = arm_urdf(hand=False).replace('size="0.05 0.05 0.16"', 'size="0.5 0.5 0.5"')
    _, fields = imported(written(tmp_path, fat))
    assert ["l1", "l3"] in fields["may_touch"]


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("pybullet_data:r2d2.urdf", "is neither clearly a base, nor an arm, nor a gripper"),
        ("example_robot_data:tiago_description/robots/tiago.urdf", "branches at 'torso_lift_link'"),
        ("pybullet_data:husky/husky.urdf", "joint 'imu_joint' gives its"),
    ],
)
def test_what_cannot_be_imported_is_reported_with_the_way_out(source: str, words: str) -> None:
    with pytest.raises(UrdfError, match=words):
        imported(shipped(source))


def test_a_joint_without_a_range_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UrdfError, match="joint 'j1' has no range"):
        imported(written(tmp_path, arm_urdf().replace('lower="-2.5"', 'lower="2.5"', 1)))


def test_what_a_part_leaves_out_of_its_file_is_noted(tmp_path: Path) -> None:
    wheels = "".join(
        f'<link name="{side}_wheel"/><joint name="{side}_wheel_joint" type="continuous"><parent link="foot"/>'
        f'<child link="{side}_wheel"/></joint>'
        for side in ("left", "right")
    )
    part, _ = imported(written(tmp_path, arm_urdf(extra=wheels)))
    assert "cut off, with all descendants: palm" in part.notes
    assert any(
        "left_joint, left_wheel_joint, right_wheel_joint; import them as separate parts" in note for note in part.notes
    )


def test_a_state_that_says_only_some_joints_is_noted(tmp_path: Path) -> None:
    srdf = SRDF.replace('<joint name="j4" value="1.0"/>', "")
    part, fields = imported(written(tmp_path, arm_urdf()), written(tmp_path, srdf, "small.srdf"), group="arm")
    assert "states" not in fields
    assert any("'ready' of the SRDF was left out: it lacks j4" in note for note in part.notes)


def test_names_of_states_and_pairs_that_the_urdf_lacks_are_noted(tmp_path: Path) -> None:
    srdf = SRDF.replace('link2="palm"', 'link2="plam"').replace(
        '<joint name="j1" value="0"/>', '<joint name="j0" value="0"/>'
    )
    part, _ = imported(written(tmp_path, arm_urdf()), written(tmp_path, srdf, "small.srdf"), group="arm")
    assert any("ignored, because the URDF lacks what the SRDF names there: j0, plam" in note for note in part.notes)


def test_faults_of_a_urdf_and_its_srdf_come_at_once(tmp_path: Path) -> None:
    srdf = SRDF.replace('tip_link="l5"', 'tip_link="l9"').replace('name="j2" value="0.5"', 'name="j2" value="half"')
    srdf = srdf.replace('name="j4" value="1.0"', 'name="j4" value=""')
    with pytest.raises(UrdfError) as error:
        imported(written(tmp_path, arm_urdf()), written(tmp_path, srdf, "small.srdf"), group="arm")
    assert ["'half'" in f or "''" in f or "lacks: link 'l9'" in f for f in error.value.faults] == [True] * 3


def test_all_lost_meshes_are_reported_with_the_users_file(tmp_path: Path) -> None:
    text = arm_urdf(hand=False).replace('<box size="0.05 0.05 0.16"/>', '<mesh filename="one.stl"/>', 1)
    urdf = written(tmp_path, text.replace('<box size="0.1 0.1 0.1"/>', '<mesh filename="two.stl"/>'))
    with pytest.raises(ConfigurationError) as error:
        imported(urdf)
    assert {problem.source for problem in error.value.problems} == {str(urdf)}
    assert len(error.value.problems) == 2


def test_the_guessed_slip_of_four_wheels_is_noted() -> None:
    part, fields = imported(shipped("pybullet_data:husky/husky.urdf"), cut=("imu_link",))
    assert any(f"turning_slip: {fields['turning_slip']:g}" in note for note in part.notes)
