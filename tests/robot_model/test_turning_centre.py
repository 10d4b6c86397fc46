"""A base that turns about a point ahead of its URDF's root has its frame there."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.manipulation.collision.scene_from_world_model import hand_links
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.robot_model.compose import compose_robot, load_robot_model
from bestman_bt.robot_model.model import BaseModel, RobotModel


def husky(turning_centre: str) -> RobotModel:
    change = Document({"parts": {"base": {"set": {"turning_centre": turning_centre}}}})
    return compose_robot("husky", read_document(find_data("robot", "husky_panda")).merged(change))


def test_the_base_frame_moves_and_all_that_is_on_the_base_stays() -> None:
    before, after = husky("0 cm"), husky("10 cm")
    moved = np.array(before.of(BaseModel)["base"].footprint) - np.array(after.of(BaseModel)["base"].footprint)
    assert moved == pytest.approx(np.tile([0.1, 0.0], (len(moved), 1)), abs=1e-3)
    home = before.postures["home"]
    for frame in ("panda_grasptarget", "rear_left_wheel_link", "lidar_link"):
        was, now = (ForwardKinematics(model).pose(frame, home).position for model in (before, after))
        assert was - now == pytest.approx([0.1, 0.0, 0.0], abs=1e-6)


def test_a_base_that_drifts_while_turning_needs_more_clearance() -> None:
    model = husky("0 cm").of(BaseModel)["base"]
    assert model.part.turning_drift == pytest.approx(0.12)
    footprint = Footprint.of(model)
    assert footprint.turning_radius == pytest.approx(footprint.circumscribed_radius + 0.12)


def test_the_knuckles_of_a_linkage_belong_to_the_hand() -> None:
    links = hand_links(load_robot_model("diff_xarm6"))
    assert {"left_inner_knuckle", "right_inner_knuckle", "left_finger", "xarm_gripper_base_link"} <= set(links)
