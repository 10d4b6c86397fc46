"""Postures that are proposed are free, look down, and are out of the way where they should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.collision.coal_world import CoalCollisionModel
from bestman_bt.manipulation.collision.planning_scene import AttachedObject, PlanningScene
from bestman_bt.manipulation.collision.scene_from_world_model import hand_links
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.posture_search import PostureSearch
from bestman_bt.messages import Cylinder, PlacedShape, Pose
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel

HEAD = {"head_pan_joint": 0.0, "head_tilt_joint": np.radians(47.0)}


@pytest.fixture(scope="module")
def search() -> PostureSearch:
    return PostureSearch(load_robot_model("diff_xarm6"), samples=12)


@pytest.fixture(scope="module")
def home(search: PostureSearch) -> np.ndarray:
    return search.home(np.random.default_rng(0))


def assert_free_and_looking_down(search: PostureSearch, positions: np.ndarray) -> None:
    world = CoalCollisionModel(search.robot).world(PlanningScene(positions=HEAD))
    assert world.colliding_pairs(positions) == ()
    np.testing.assert_allclose(
        DampedLeastSquares(search.robot).tool_pose(positions).rotation[:, 2], [0, 0, -1], atol=1e-3
    )


def test_home_is_in_front_with_the_hand_down(search: PostureSearch, home: np.ndarray) -> None:
    assert_free_and_looking_down(search, home)
    x, y, _ = DampedLeastSquares(search.robot).tool_pose(home).position
    assert x > 0.35
    assert abs(y) < 0.01


@pytest.mark.slow
def test_carry_needs_less_room_than_home_and_hides_less_of_the_table(search: PostureSearch, home: np.ndarray) -> None:
    carry = search.carry(np.random.default_rng(0), home, HEAD)
    assert_free_and_looking_down(search, carry)
    assert search.radius(carry) < search.radius(home) - 0.1
    assert search.hidden(carry, HEAD) < search.hidden(home, HEAD)


@pytest.mark.slow
@pytest.mark.parametrize("posture", ["carry", "carry_beside"])
def test_a_posture_for_carrying_has_room_for_what_is_carried(
    search: PostureSearch, home: np.ndarray, posture: str
) -> None:
    carrying = getattr(search, posture)(np.random.default_rng(3), home, HEAD)
    shapes = (PlacedShape(Cylinder(0.04, 0.15), Pose(np.array([0.0, 0.0, 0.025]))),)
    touched = frozenset(hand_links(search.robot))
    held = AttachedObject("held", shapes, search.robot.of(ArmModel)["arm"].tool_frame, Pose(), touched)
    world = CoalCollisionModel(search.robot).world(PlanningScene(positions=HEAD).holding(held))
    assert world.colliding_pairs(carrying) == ()


@pytest.mark.slow
def test_a_motion_leads_from_home_to_a_posture_for_carrying_and_a_short_one_is_preferred(
    search: PostureSearch, home: np.ndarray
) -> None:
    world = CoalCollisionModel(search.robot).world(PlanningScene(positions={}))
    lengths = []
    for weight in (0.0, 1.0):
        other = replace(search, motion_weight=weight)
        carry = other.carry(np.random.default_rng(4), home, HEAD)
        plan = RRTConnect().plan(home, [carry], world, search.robot.of(ArmModel)["arm"], np.random.default_rng(0))
        lengths.append(plan.length)
    assert lengths[1] < lengths[0] - 0.2


@pytest.mark.slow
def test_what_stands_out_beyond_the_base_less_is_preferred(search: PostureSearch, home: np.ndarray) -> None:
    assert search.stands_out(home) == pytest.approx(0.25, abs=0.03)
    careless = replace(search, overhang_weight=0.0)
    careful = replace(search, overhang_weight=10.0)
    beside = [each.carry_beside(np.random.default_rng(2), home, HEAD) for each in (careless, careful)]
    assert search.stands_out(beside[1]) < search.stands_out(beside[0]) - 0.05


@pytest.mark.slow
def test_carry_beside_is_beside_and_lower(search: PostureSearch, home: np.ndarray) -> None:
    beside = search.carry_beside(np.random.default_rng(0), home, HEAD)
    assert_free_and_looking_down(search, beside)
    assert DampedLeastSquares(search.robot).tool_pose(beside).position[1] < -0.15


@pytest.mark.slow
def test_equal_seeds_propose_equal_postures(search: PostureSearch, home: np.ndarray) -> None:
    np.testing.assert_array_equal(search.home(np.random.default_rng(0)), home)
