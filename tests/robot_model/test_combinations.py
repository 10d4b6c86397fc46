"""Any base carries any arm with any end effector."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.data import data_names
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.robot_model.compose import combine, load_robot_model
from bestman_bt.robot_model.model import ArmModel, BaseModel
from bestman_bt.robot_model.sensor_parts import CameraPart, LidarPart

BASES = ("differential_base", "omni_base", "husky_base")
ARMS = ("panda_arm", "iiwa_arm", "xarm6_arm", "ur5e_arm", "ur5_arm", "ur10_arm", "xarm7_arm", "kinova_arm")
HANDS = ("panda_hand", "wsg50", "xarm_gripper", "pr2_gripper", "suction", "allegro_hand")


@pytest.mark.quick_cases(12)
@pytest.mark.parametrize(("base", "arm", "hand"), list(itertools.product(BASES, ARMS, HANDS)))
def test_the_three_become_one_urdf_with_unique_names_and_real_meshes(base: str, arm: str, hand: str) -> None:
    robot = combine(base, arm, hand)
    urdf = ET.fromstring(robot.urdf)
    names = [element.get("name") for tag in ("link", "joint") for element in urdf.findall(tag)]
    assert len(set(names)) == len(names)
    assert all(Path(mesh.get("filename")).is_file() for mesh in urdf.iter("mesh"))
    assert all(float(link.find("inertial/mass").get("value")) > 0 for link in urdf.findall("link"))
    assert robot.hand_of == {"gripper": "arm"}
    limits = {joint.get("name"): joint.find("limit") for joint in urdf.findall("joint")}
    assert all(joint in robot.postures["home"] for joint in robot.of(ArmModel)["arm"].joint_names)
    for joint, lower, upper in zip(
        robot.of(ArmModel)["arm"].joint_names,
        robot.of(ArmModel)["arm"].lower,
        robot.of(ArmModel)["arm"].upper,
        strict=True,
    ):
        assert lower < robot.postures["home"][joint] < upper
        assert float(limits[joint].get("lower")) == pytest.approx(lower)


PARTIAL = {"a1", "bench_arm", "turtle"}
"""Robots that are no mobile manipulators."""


@pytest.mark.parametrize("name", sorted({*data_names("robot")} - PARTIAL))
def test_shipped_robots_have_what_skills_and_postures_need(name: str) -> None:
    robot = load_robot_model(name)
    assert {"home", "carry", "look"} <= set(robot.postures)
    assert robot.of(CameraPart)
    assert robot.of(LidarPart)
    nearest = min(Footprint(np.array(base.footprint)).inscribed_radius for base in robot.of(BaseModel).values())
    assert all(lidar.range_min < nearest for lidar in robot.of(LidarPart).values())  # all outside the outline is seen
    assert all(camera.optical_frame for camera in robot.of(CameraPart).values())
