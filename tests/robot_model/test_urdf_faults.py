"""Everything that is wrong with a URDF is told at once, in words; nothing hangs or breaks."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.robot_model.urdf_source import UrdfError, read_subtree
from bestman_bt.robot_model.urdf_tree import UrdfTree
from tests.robot_model.small_robot import arm_urdf, written

BACK = '<joint name="back" type="fixed"><parent link="l5"/><child link="foot"/></joint>'


def faults_of(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(UrdfError) as error:
        UrdfTree(written(folder, text))
    return error.value.faults


def test_both_readers_report_joints_that_form_a_cycle(tmp_path: Path) -> None:
    text = arm_urdf(extra=BACK)
    assert faults_of(tmp_path, text) == ("small.urdf: has no root link: its joints form a cycle",)
    with pytest.raises(UrdfError, match="form a cycle"):
        read_subtree(written(tmp_path, text), "foot", ())


def test_a_cycle_beside_a_tree_is_reported(tmp_path: Path) -> None:
    extra = '<link name="a"/><link name="b"/>' + "".join(
        f'<joint name="{n}" type="fixed"><parent link="{p}"/><child link="{c}"/></joint>'
        for n, p, c in (("ab", "a", "b"), ("ba", "b", "a"))
    )
    assert "is not connected: a, b form a cycle" in faults_of(tmp_path, arm_urdf(extra=extra))[0]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('effort="30"', 'effort="sixty"', "joint 'j1' gives its limit effort as 'sixty': that should be a number"),
        ('xyz="0 0 0.1"', 'xyz="0 0 nan"', "link 'foot' gives its xyz as '0 0 nan': that should be three numbers"),
        ('type="revolute"', 'type="floating"', "joint 'j1' is floating: only revolute, continuous, prismatic, fixed"),
        ('mimic joint="left_joint"', 'mimic joint="nope"', "joint 'right_joint' mimics 'nope', which is not a joint"),
        ('name="l2"', 'name="l3"', "link 'l3' is defined twice"),
        ('name="j2"', 'name="j3"', "joint 'j3' is defined twice"),
        ('<link name="l2">', '<link name="l2"><inertial><mass value="-1"/></inertial>', "should not be negative"),
    ],
)
def test_a_fault_is_reported_in_words(tmp_path: Path, before: str, after: str, words: str) -> None:
    text = arm_urdf().replace('<origin xyz="0 0 0.05"/>', '<origin xyz="0 0 0.1"/>')
    assert any(words in fault for fault in faults_of(tmp_path, text.replace(before, after, 1)))


def test_a_parent_that_is_no_link_is_one_fault(tmp_path: Path) -> None:
    (fault,) = faults_of(tmp_path, arm_urdf().replace('<parent link="l2"/>', '<parent link="l22"/>'))
    assert "the parent of joint 'j3' is 'l22', which is not a link; did you mean 'l2'?" in fault


def test_joints_that_mimic_each_other_are_reported(tmp_path: Path) -> None:
    text = arm_urdf().replace('effort="30"/></joint>', 'effort="30"/>@</joint>').replace("@", "", 5)
    text = text.replace("@", '<mimic joint="right_joint"/>', 1).replace("@", "")
    assert "joints left_joint, right_joint mimic each other in a circle" in faults_of(tmp_path, text)[0]


def test_all_faults_come_at_once(tmp_path: Path) -> None:
    text = arm_urdf(extra='<link name="loose"/>').replace('effort="30"', 'effort="sixty"', 1)
    faults = faults_of(tmp_path, text.replace('upper="2.5"', 'upper="inf"', 1))
    assert [fault.partition(": ")[2][:20] for fault in faults] == [
        "should have one root",
        "joint 'j1' gives its",
        "joint 'j1' gives its",
    ]


def test_all_lost_meshes_come_at_once(tmp_path: Path) -> None:
    text = arm_urdf().replace('<box size="0.05 0.05 0.16"/>', '<mesh filename="package://a/one.stl"/>', 1)
    text = text.replace('<box size="0.1 0.1 0.1"/>', '<mesh filename="two.stl"/>')
    with pytest.raises(UrdfError) as error:
        read_subtree(written(tmp_path, text), None, ())
    assert sorted(fault.split()[4] for fault in error.value.faults) == ["package://a/one.stl", "two.stl"]


def test_the_root_cannot_be_cut_off(tmp_path: Path) -> None:
    with pytest.raises(UrdfError, match="'foot' is its root: nothing would be left"):
        UrdfTree(written(tmp_path, arm_urdf()), cut=("foot",))
