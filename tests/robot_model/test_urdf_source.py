"""URDF and SRDF files of others: meshes are found, faults are told, names are of one thing."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.robot_model.urdf_source import UrdfError, locate_mesh, locate_urdf, read_srdf, read_subtree
from bestman_bt.robot_model.urdf_tree import UrdfTree
from tests.robot_model.small_robot import SRDF, arm_urdf, written


@pytest.fixture
def ros_folder(tmp_path: Path) -> Path:
    for folder in ("ws/my_arm/meshes", "ws/other/urdf"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "ws/my_arm/meshes/link.stl").write_bytes(b"")
    return tmp_path / "ws"


def test_a_package_is_found_beside_the_urdfs_own(ros_folder: Path) -> None:
    found = locate_mesh("package://my_arm/meshes/link.stl", ros_folder / "other/urdf/arm.urdf")
    assert found == ros_folder / "my_arm/meshes/link.stl"


def test_a_package_is_found_where_it_is_reported_to_be(
    ros_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    urdf = tmp_path_factory.mktemp("elsewhere") / "arm.urdf"
    assert locate_mesh("package://my_arm/meshes/link.stl", urdf, [ros_folder]).is_file()


def test_a_package_is_found_by_ros_path(ros_folder: Path, tmp_path_factory, monkeypatch: pytest.MonkeyPatch) -> None:
    urdf = tmp_path_factory.mktemp("elsewhere") / "arm.urdf"
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{ros_folder}")
    assert locate_mesh("package://my_arm/meshes/link.stl", urdf).is_file()


def test_a_package_whose_folder_has_another_name_is_found_without_it(ros_folder: Path) -> None:
    urdf = ros_folder / "my_arm/arm.urdf"
    assert locate_mesh("package://arm_description/meshes/link.stl", urdf).is_file()


def test_a_missing_mesh_reports_where_it_was_looked_for(ros_folder: Path) -> None:
    with pytest.raises(UrdfError, match=r"no such mesh: package://my_arm/no.stl \(looked for in .*ws/other/urdf"):
        locate_mesh("package://my_arm/no.stl", ros_folder / "other/urdf/arm.urdf")


def test_the_extra_is_named_where_its_package_is_missing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from importlib.metadata import PackageNotFoundError

    from bestman_bt.robot_model import urdf_source

    def missing(name: str) -> None:
        raise PackageNotFoundError(name)

    urdf_source.example_robots.cache_clear()
    monkeypatch.setattr(urdf_source, "distribution", missing)
    with pytest.raises(UrdfError, match=r"pip install .*\[robots\]'"):
        locate_urdf("example_robot_data:ur_description/urdf/ur5_robot.urdf", tmp_path)
    urdf_source.example_robots.cache_clear()


def test_a_joint_that_is_called_as_a_link_gets_a_name_of_its_own(tmp_path: Path) -> None:
    text = arm_urdf().replace('name="left_joint"', 'name="left_finger"').replace("left_joint", "left_finger")
    subtree = read_subtree(written(tmp_path, text), "palm", ())
    names = [element.get("name") for element in subtree.elements]
    assert sorted(names) == sorted(set(names))
    assert [(mimic.joint, mimic.leader) for mimic in subtree.mimics] == [("right_joint", "left_finger_joint")]


def test_an_origin_that_is_no_numbers_is_reported(tmp_path: Path) -> None:
    text = arm_urdf().replace('<origin xyz="0 0 0.04"/>', '<origin xyz="$(optenv X 0 0 0)"/>', 1)
    with pytest.raises(UrdfError, match=r"joint 'left_joint' gives its xyz as '\$\(optenv X 0 0 0\)'"):
        read_subtree(written(tmp_path, text), None, ())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "cannot be read as a URDF"),
        ("<sdf/>", "its root element is <sdf>"),
        (arm_urdf(extra='<link name="loose"/>'), "should have one root link, it has foot, loose"),
        (
            arm_urdf().replace('<child link="l3"/>', '<child link="l7"/>'),
            "the child of joint 'j3' is 'l7', which is not a link",
        ),
        (
            arm_urdf().replace('<child link="right_finger"/>', '<child link="left_finger"/>'),
            "left_finger is the child of two joints",
        ),
    ],
)
def test_what_is_no_tree_of_links_is_reported(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UrdfError, match=words):
        _ = UrdfTree(written(tmp_path, text)).root


def test_groups_of_an_srdf_are_their_joints_that_move_by_themselves(tmp_path: Path) -> None:
    tree, srdf = UrdfTree(written(tmp_path, arm_urdf())), read_srdf(written(tmp_path, SRDF, "small.srdf"))
    assert tree.group_joints(srdf, "arm") == ["j1", "j2", "j3", "j4", "j5"]
    assert tree.group_joints(srdf, "hand") == ["left_joint"]  # the right one mimics it
    assert srdf.states["arm"]["ready"]["j4"] == 1.0
    with pytest.raises(UrdfError, match="no group 'arn'; did you mean 'arm'"):
        srdf.group("arn")
