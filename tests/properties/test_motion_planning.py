"""What holds for each motion planner, for two joints among any discs that they must not come into."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import ndimage

from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.checked_edges import dense_points
from bestman_bt.manipulation.motion_planning.ompl_planners import AORRTC
from bestman_bt.manipulation.motion_planning.portfolio import Portfolio
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from tests.manipulation.motion_planning.joint_worlds import JointWorld
from tests.properties.profile import examples
from tests.robot_models import joint_group_model

LOWER, UPPER = np.array([-2.0, -1.0]), np.array([2.0, 1.5])
CELL, ROOM = 0.05, 0.1
PLANNERS = [RRTConnect(), Portfolio(), pytest.param(AORRTC, marks=pytest.mark.slow)]
places = st.tuples(st.floats(-2.0, 2.0), st.floats(-1.0, 1.5))
discs = st.lists(st.tuples(places, st.floats(0.1, 0.8)), max_size=6)


def clearance(points, obstacles):
    """Radians from points (N, 2) to the nearest disc; negative inside."""
    gaps = [np.linalg.norm(points - np.array(middle), axis=1) - radius for middle, radius in obstacles]
    return np.min([np.full(len(points), np.inf), *gaps], axis=0)


def connected(start, goal, obstacles):
    """Whether cells that are ``ROOM`` away from all discs lead from one to the other."""
    x, y = (np.arange(low, high + 1e-9, CELL) for low, high in zip(LOWER, UPPER, strict=True))
    cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    parts, _ = ndimage.label((clearance(cells.reshape(-1, 2), obstacles) > ROOM).reshape(cells.shape[:2]))
    one, other = (parts[tuple(np.round((place - LOWER) / CELL).astype(int))] for place in (start, goal))
    return one == other != 0


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("planner", PLANNERS)
@examples(25)
@given(discs, places, places, st.booleans(), st.integers(0, 2**32 - 1))
def test_a_path_is_free_and_found_where_there_is_room_in_any_order_of_the_joints(
    planner, obstacles, start, goal, swapped, seed
):
    start, goal = np.array(start), np.array(goal)
    assume(clearance(np.array([start, goal]), obstacles).min() > 0.01)
    order = [1, 0] if swapped else [0, 1]
    limits = joint_group_model(tuple("ab"), lower=tuple(LOWER[order]), upper=tuple(UPPER[order]))
    world = JointWorld(lambda q: bool(clearance(q[order][None], obstacles)[0] > 0.0), tuple("ab"))
    plan, code = None, ""
    try:
        plan = planner.plan(start[order], [goal[order]], world, limits, np.random.default_rng(seed))
    except MotionPlanningError as error:
        code = error.code
    if plan is None:
        assert code in (PlanningErrorCode.NO_PATH, PlanningErrorCode.TIMEOUT)
        assert not connected(start, goal, obstacles)
        return
    path = plan.path[:, order]
    np.testing.assert_array_equal(path[[0, -1]], [start, goal])
    assert ((path >= LOWER - 1e-9) & (path <= UPPER + 1e-9)).all()
    assert clearance(np.array([*dense_points(path, 0.001)]), obstacles).min() > -1e-3
    assert plan.length >= np.linalg.norm(goal - start) - 1e-9


@pytest.mark.parametrize("planner", PLANNERS)
@examples(10)
@given(st.integers(0, 1), st.sampled_from([math.nan, math.inf, -math.inf]), st.booleans())
def test_positions_that_are_no_numbers_are_refused_by_name(planner, joint, value, of_start):
    start, goal = np.zeros(2), np.ones(2)
    wrong = start if of_start else goal
    wrong[joint] = value
    limits = joint_group_model(tuple("ab"), lower=tuple(LOWER), upper=tuple(UPPER))
    world = JointWorld(lambda q: True, tuple("ab"))
    with pytest.raises(ManipulationError, match=("start" if of_start else "goal 0") + " should be finite"):
        planner.plan(start, [goal], world, limits, np.random.default_rng(0))
