from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision import SceneObstacle
from bestman_bt.manipulation.motion_planning import PathCache, PathCacheParameters, PlanningError
from bestman_bt.manipulation.motion_planning.edge import dense_points
from bestman_bt.messages import Box, PlacedShape, Pose
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
    cache = PathCache(parameters=PathCacheParameters(quantum=10.0))
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
    cache = PathCache(parameters=PathCacheParameters(size=1))
    cache.plan(START, [GOAL], world, arm, rng)
    cache.plan(GOAL, [START], world, arm, rng)
    cache.plan(START, [GOAL], world, arm, rng)
    assert (cache.hits, cache.misses) == (0, 3)
    with pytest.raises(PlanningError):
        cache.plan(START, [np.array([0.0, 1.2, 0.0, -1.2, 0.0, 2.0, 0.0])], world, arm, rng)
    assert cache.misses == 3
