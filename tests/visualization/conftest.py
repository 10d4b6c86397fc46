from __future__ import annotations

import pytest

from bestman_bt.visualization import DescribedNode

ROBOT = """
<robot name="cart">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="floor_point"/>
  <link name="chassis">
    <visual><geometry><box size="0.5 0.4 0.3"/></geometry><material name="grey"/></visual>
    <collision><geometry><box size="0.6 0.5 0.4"/></geometry></collision>
  </link>
  <joint name="chassis_fixed" type="fixed">
    <parent link="floor_point"/><child link="chassis"/><origin xyz="0 0 0.2"/>
  </joint>
  <link name="upper_arm">
    <visual><origin xyz="0.2 0 0"/><geometry><cylinder radius="0.03" length="0.4"/></geometry></visual>
  </link>
  <joint name="arm_shoulder" type="revolute">
    <parent link="chassis"/><child link="upper_arm"/>
    <origin xyz="0.1 0.05 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="0 1 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <link name="hand"/>
  <joint name="arm_slide" type="prismatic">
    <parent link="upper_arm"/><child link="hand"/>
    <origin xyz="0.4 0 0" rpy="0 0.4 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.3" effort="1" velocity="1"/>
  </joint>
  <link name="eye"/>
  <joint name="eye_fixed" type="fixed">
    <parent link="chassis"/><child link="eye"/><origin xyz="0.2 0 0.5" rpy="-1.9 0 -1.5708"/>
  </joint>
</robot>
"""


@pytest.fixture
def robot_urdf() -> str:
    return ROBOT


@pytest.fixture
def fetch_nodes() -> list[DescribedNode]:
    """A small fetch: uid = position."""
    return [
        DescribedNode(0, "fetch", "Sequence", None),
        DescribedNode(1, "to the table", "NavigateTo", 0),
        DescribedNode(2, "get it", "Fallback", 0),
        DescribedNode(3, "", "Sequence", 2),
        DescribedNode(4, "PlanGrasp", "PlanGrasp", 3),
        DescribedNode(5, "Grasp", "Grasp", 3),
        DescribedNode(6, "look again", "Sequence", 2),
        DescribedNode(7, "LookAt", "LookAt", 6),
        DescribedNode(8, "second grasp", "Grasp", 6),
        DescribedNode(9, "put down", "PlaceOn", 0),
    ]
