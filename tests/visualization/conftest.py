from __future__ import annotations

import pytest

from bestman_bt.records.events import Category, DescribedNode, StatesEvent, TreeEvent
from bestman_bt.records.nodes import NodeList

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


CATEGORIES: dict[str, Category] = {"Sequence": "control", "Fallback": "control", "Holding": "condition"}


def tree_of(*nodes: tuple[int | None, str, str]) -> TreeEvent:
    """(parent, name, type) of the nodes, whose uids are 1 and so on."""
    described = [
        DescribedNode(uid, parent, name, kind, CATEGORIES.get(kind, "action"), f"{name}::{uid}", {}, "")
        for uid, (parent, name, kind) in enumerate(nodes, start=1)
    ]
    return TreeEvent(described, "", "Main")


def nodes_of(tree: TreeEvent) -> NodeList:
    nodes = NodeList()
    nodes.add(tree)
    return nodes


def changed(time: float, *changes: tuple[int, int] | tuple[int, int, str], tick: int = 0) -> StatesEvent:
    """(uid, state) or (uid, state, what the node says), of one tick."""
    messages = {change[0]: change[2] for change in changes if len(change) == 3}
    return StatesEvent(time, tick, [change[:2] for change in changes], messages)


@pytest.fixture
def fetch_tree() -> TreeEvent:
    """A small fetch of ten nodes."""
    return tree_of(
        (None, "fetch", "Sequence"),
        (1, "to the table", "NavigateTo"),
        (1, "get it", "Fallback"),
        (3, "", "Sequence"),
        (4, "PlanGrasp", "PlanGrasp"),
        (4, "Grasp", "Grasp"),
        (3, "look again", "Sequence"),
        (7, "LookAt", "LookAt"),
        (7, "second grasp", "Grasp"),
        (1, "put down", "PlaceOn"),
    )
