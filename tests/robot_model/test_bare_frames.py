from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio
import pytest

from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.mounting import without_frame_links


def place(model: pinocchio.Model, q: np.ndarray, link: str) -> Pose:
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q)
    frame = model.getFrameId(link, pinocchio.FrameType.BODY)
    assert frame < model.nframes, f"no link {link}"
    return Pose.from_matrix(pinocchio.updateFramePlacement(model, data, frame).homogeneous)


def test_every_link_and_frame_stays_where_it_was() -> None:
    urdf = load_robot_model("diff_panda").urdf
    lean, places = without_frame_links(urdf)
    before, after = pinocchio.buildModelFromXML(urdf), pinocchio.buildModelFromXML(lean)
    assert list(before.names) == list(after.names)
    q = pinocchio.randomConfiguration(before, np.full(before.nq, -1.0), np.full(before.nq, 1.0))
    assert {"lidar_link", "head_camera_optical_frame"} <= set(places)
    for link in (element.get("name", "") for element in ET.fromstring(urdf).findall("link")):
        holder, holder_from_link = places.get(link, (link, Pose()))
        found = place(after, q, holder) @ holder_from_link
        assert found.matrix == pytest.approx(place(before, q, link).matrix, abs=1e-7)


def test_links_with_a_shape_stay_and_frames_on_moving_joints_too() -> None:
    urdf = """<robot name="r">
      <link name="root"/>
      <link name="seen"><visual><geometry><sphere radius="1"/></geometry></visual></link>
      <link name="moving"/><link name="frame"/>
      <joint name="a" type="fixed"><parent link="root"/><child link="seen"/></joint>
      <joint name="b" type="continuous"><parent link="seen"/><child link="moving"/><axis xyz="0 0 1"/></joint>
      <joint name="c" type="fixed"><origin xyz="1 2 3"/><parent link="moving"/><child link="frame"/></joint>
    </robot>"""
    lean, places = without_frame_links(urdf)
    assert [link.get("name") for link in ET.fromstring(lean).findall("link")] == ["root", "seen", "moving"]
    assert list(places) == ["frame"]
    assert places["frame"][0] == "moving"
    assert places["frame"][1].position == pytest.approx([1.0, 2.0, 3.0])


@pytest.mark.parametrize("rpy", [(0.3, -0.7, 2.9), (-3.0, 1.2, 0.1), (0.4, np.pi / 2, 0.9), (1.1, -np.pi / 2, -2.0)])
def test_roll_pitch_yaw_give_the_same_rotation_back(rpy: tuple[float, float, float]) -> None:
    pose = Pose.from_xyz_rpy((0.0, 0.0, 0.0), rpy)
    again = Pose.from_xyz_rpy((0.0, 0.0, 0.0), pose.roll_pitch_yaw)
    assert again.rotation == pytest.approx(pose.rotation, abs=1e-7)


def test_a_frame_on_a_turned_frame_is_where_both_joints_put_it() -> None:
    urdf = """<robot name="r">
      <link name="solid"><visual><geometry><sphere radius="1"/></geometry></visual></link>
      <link name="turned"/><link name="ahead"/>
      <joint name="a" type="fixed"><origin xyz="1 0 0" rpy="0 0 1.5707963"/>
        <parent link="solid"/><child link="turned"/></joint>
      <joint name="b" type="fixed"><origin xyz="2 0 0"/><parent link="turned"/><child link="ahead"/></joint>
    </robot>"""
    _, places = without_frame_links(urdf)
    holder, solid_from_ahead = places["ahead"]
    assert holder == "solid"
    assert solid_from_ahead.position == pytest.approx([1.0, 2.0, 0.0], abs=1e-6)
