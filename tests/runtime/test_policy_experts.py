"""Who demonstrates the shipped policies takes its grasps from the grasp planner."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.policy_experts import picking_expert


def test_the_expert_takes_the_cup_as_the_grasp_planner_ranks_it_first_from_above() -> None:
    picked = picking_expert(load_robot_model("diff_panda"), "cup").picked
    assert (picked.rise, picked.width, picked.opening) == pytest.approx((0.02, 0.066, 0.08), abs=1e-6)


def test_what_the_hand_cannot_take_from_above_has_no_expert() -> None:
    with pytest.raises(LookupError, match="cannot take the crate from above"):
        picking_expert(load_robot_model("diff_panda"), "crate")
