from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies, ForwardKinematics
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose
from bestman_bt.robot_model.model import ArmModel, BaseModel
from bestman_bt.world_model.world_model import HeldObject


def around(bodies):
    points = np.concatenate(bodies)
    return points.min(axis=0), points.max(axis=0)


def test_the_arm_stands_ahead_of_the_base_at_home_and_over_it_where_it_is_carried(diff_panda):
    bodies, front = ArmBodies(diff_panda), max(x for x, _ in diff_panda.of(BaseModel)["base"].footprint)
    _, ahead = around(bodies.at(diff_panda.postures["home"]))
    _, over = around(bodies.at(diff_panda.postures["carry"]))
    assert ahead[0] > front + 0.2
    assert over[0] < front


def test_only_what_moves_with_the_arm_belongs_to_it(diff_panda):
    bodies, home = ArmBodies(diff_panda), diff_panda.postures["home"]
    low, _ = around(bodies.at(home))
    assert low[2] > 0.3
    looking_down = around(bodies.at({**home, "head_tilt_joint": 0.5}))
    np.testing.assert_array_equal(looking_down, around(bodies.at(home)))


def test_what_is_held_is_a_body_where_it_is_believed_in_the_hand(diff_panda):
    bodies, home = ArmBodies(diff_panda), diff_panda.postures["home"]
    long = ObjectModel("bar", (1.0, 0.0, 0.0), 0.5, 0.5, (PlacedShape(Box((0.02, 0.02, 0.8)), Pose()),))
    held = HeldObject("bar", long, Pose(np.array([0.0, 0.0, 0.1])), 0.02)
    bare, bar = bodies.at(home), bodies.at(home, held)[-1]
    assert len(bodies.at(home, held)) == len(bare) + 1
    middle = ForwardKinematics(diff_panda).pose(diff_panda.of(ArmModel)["arm"].tool_frame, home) @ held.tool_from_object
    assert bar.mean(axis=0) == pytest.approx(middle.position, abs=1e-9)
    assert np.linalg.norm(bar[0] - bar[-1]) == pytest.approx(np.sqrt(0.8**2 + 2 * 0.02**2))
