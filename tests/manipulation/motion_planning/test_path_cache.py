from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision import SceneObstacle
from bestman_bt.manipulation.motion_planning import (
    PathCache,
    PlanningError,
    RRTConnect,
)
from bestman_bt.manipulation.motion_planning.edge import dense_points
from bestman_bt.messages import Box, PlacedShape, Pose
from tests.manipulation.motion_planning.joint_worlds import TWO, JointWorld, Kept
from tests.manipulation.table_and_shelf import problems, table_and_shelf

START, GOAL = problems()[6]


@pytest.fixture
def cache() -> PathCache:
    return PathCache()


def test_the_same_question_in_the_same_scene_is_answered_from_memory(cache, world, collision_model, arm, rng):
    first = cache.plan(START, [GOAL], world, arm, rng)
    rebuilt = collision_model.world(table_and_shelf())
    assert rebuilt.fingerprint == world.fingerprint
    again = cache.plan(START, [GOAL], rebuilt, arm, rng)
    assert np.array_equal(again.path, first.path)
    assert (cache.hits, cache.misses) == (1, 1)


def test_a_start_beside_the_known_one_gets_a_path_from_where_it_is(world, arm, rng):
    cache = PathCache(quantum=10.0)
    cache.plan(START, [GOAL], world, arm, rng)
    beside = START + 1e-3
    plan = cache.plan(beside, [GOAL], world, arm, rng)
    assert cache.hits == 1
    assert np.array_equal(plan.path[0], beside)
    assert all(world.is_free(q) for q in dense_points(plan.path, 0.01))


def test_a_new_obstacle_invalidates_the_path(cache, world, collision_model, kinematics, arm, rng):
    first = cache.plan(START, [GOAL], world, arm, rng)
    points = list(dense_points(first.path, 0.01))
    ends = [kinematics.tool_pose(q).position for q in (START, GOAL)]
    middle = max(
        (kinematics.tool_pose(q) for q in points), key=lambda p: min(np.linalg.norm(p.position - ends, axis=1))
    )
    post = SceneObstacle("post", (PlacedShape(Box((0.02, 0.02, 0.02)), Pose(middle.position)),))
    blocked = collision_model.world(table_and_shelf().adding(post))
    assert not all(blocked.is_free(q) for q in points)
    second = cache.plan(START, [GOAL], blocked, arm, rng)
    assert cache.hits == 0
    assert all(blocked.is_free(q) for q in dense_points(second.path, 0.01))


def test_a_path_is_checked_even_where_the_world_cannot_tell_that_it_has_changed(
    cache, collision_model, arm, rng, ready
):
    """A world without a fingerprint in which a wall appears between start and goal."""

    class Nameless:
        joint_names = arm.joint_names
        fingerprint = ""
        walled = False

        def is_free(self, positions):
            return not (self.walled and abs(positions[0]) < 0.1 and positions[1] < 0.5)

        def colliding_pairs(self, positions):
            return ()

    nameless = Nameless()
    left, right = ready + np.eye(7)[0], ready - np.eye(7)[0]
    assert len(cache.plan(left, [right], nameless, arm, rng).path) == 2
    nameless.walled = True
    around = cache.plan(left, [right], nameless, arm, rng)
    assert (cache.hits, cache.misses) == (0, 2)
    assert all(nameless.is_free(q) for q in dense_points(around.path, 0.01))


def test_the_oldest_path_is_forgotten_first_and_failures_are_not_kept(world, arm, rng):
    cache = PathCache(size=1)
    cache.plan(START, [GOAL], world, arm, rng)
    cache.plan(GOAL, [START], world, arm, rng)
    cache.plan(START, [GOAL], world, arm, rng)
    assert (cache.hits, cache.misses) == (0, 3)
    with pytest.raises(PlanningError):
        cache.plan(START, [np.array([0.0, 1.2, 0.0, -1.2, 0.0, 2.0, 0.0])], world, arm, rng)
    assert cache.misses == 3


FROM, TO = np.array([0.5, 0.0]), np.array([-0.5, 0.0])


class Marked(JointWorld):
    """A world with a fingerprint of its own."""

    def __init__(self, free, mark):
        super().__init__(free)
        self._mark = mark

    @property
    def fingerprint(self):
        return self._mark


def ask(cache, start, goals, world, constraint=None):
    return cache.plan(start, goals, world, TWO, np.random.default_rng(1), constraint)


def test_starts_and_goals_a_quantum_apart_are_other_questions(cache):
    world = Marked(lambda q: True, "w")
    ask(cache, FROM, [TO], world)
    for start, goals in ((FROM + 0.03, [TO]), (FROM, [TO + 0.03]), (FROM, [TO, FROM]), (FROM, [FROM, TO])):
        ask(cache, start, goals, world)
    assert (cache.hits, cache.misses) == (0, 5)
    ask(cache, FROM, [TO], Marked(lambda q: True, "other"))
    assert (cache.hits, cache.misses) == (0, 6)
    ask(cache, FROM + 0.001, [TO - 0.001], world)
    assert (cache.hits, cache.misses) == (1, 6)


def test_a_remembered_path_begins_and_ends_where_it_is_asked_to_and_stays_as_it_was(cache):
    """Of two goals the second was reached."""
    world = Marked(lambda q: q[0] > -1.0, "w")
    goals = [np.array([-1.5, 0.0]), TO]
    with pytest.raises(PlanningError):
        ask(cache, FROM, goals[:1], world)
    first = ask(cache, FROM, goals, world)
    kept = first.path.copy()
    again = ask(cache, FROM + 0.002, [goals[0], TO + 0.002], world)
    assert (again.goal_index, cache.hits) == (1, 1)
    assert np.array_equal(again.path[[0, -1]], [FROM + 0.002, TO + 0.002])
    assert np.array_equal(first.path, kept)
    assert np.array_equal(ask(cache, FROM, goals, world).path, kept)


def test_the_path_that_was_used_last_is_kept_longest():
    cache, world = PathCache(size=2), Marked(lambda q: True, "w")
    others = [np.array([0.0, 0.5]), np.array([0.0, -0.5])]
    for goal in (TO, others[0], TO, others[1], TO):
        ask(cache, FROM, [goal], world)
    assert (cache.hits, cache.misses) == (2, 3)
    ask(cache, FROM, [others[0]], world)
    assert cache.misses == 4


def test_a_constraint_is_asked_of_new_and_of_remembered_paths():
    """Two constraints of the same words; the only way round the wall breaks the second one."""
    cache = PathCache(RRTConnect(max_checks=500, attempts=2))
    wall = Marked(lambda q: abs(q[0]) > 0.1 or q[1] > 0.8, "w")
    assert ask(cache, FROM, [TO], wall, Kept(1.5, 1.5)).path[:, 1].max() > 0.8
    free = Marked(lambda q: True, "w")
    assert ask(cache, FROM, [TO], free, Kept(0.5, 0.5)).path[:, 1].max() <= 0.5
    assert (cache.hits, cache.misses) == (0, 2)
    with pytest.raises(PlanningError, match="no path"):
        ask(cache, FROM, [TO], Marked(wall._free, "new"), Kept(0.5, 0.5))
