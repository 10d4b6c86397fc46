"""What stands behind a door is taken from the front, with the camera of the hand above the hand."""

from __future__ import annotations

import numpy as np

from behaviours.manipulation.grasp_candidates import grasp_candidates
from bestman_bt.messages import Pose
from bestman_bt.runtime.robot_session import session
from bestman_bt.world_model.world_model import ObjectBelief


def test_a_cup_on_a_shelf_of_the_fridge_is_taken_from_the_front_with_the_camera_above_the_hand() -> None:
    with session(scene="cup_in_fridge", task="fetch_from_fridge", seed=1) as opened:
        skills = opened.skills
        assert skills.wrist_camera is not None
        furniture, shelf = skills.world.surface("fridge/shelf_4")
        on_board = furniture.pose.to_pose() @ shelf.pose @ Pose(np.array([-0.15, 0.0, 0.05]))
        now = skills.clock.now()
        belief = ObjectBelief("cup", skills.world.models["cup"], on_board, 1.0, 0.005, now, "fridge/shelf_4")
        candidates = grasp_candidates(skills, belief)
        tool_from_camera = skills.base_from_tool().inverse() @ skills.wrist_camera.base_from_camera()
        inwards = skills.map_from_base.inverse().rotation @ furniture.pose.to_pose().rotation[:, 0]
        assert len(candidates) >= 3, "from several directions"
        for candidate in candidates:
            assert candidate.grasp.rotation[:, 2] @ inwards > 0.5
            assert (candidate.grasp @ tool_from_camera).position[2] > candidate.grasp.position[2] + 0.02
