"""Out of a start in collision: a small motion with ever more clearance, or a refusal that says why."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning.base import MotionPlanningError, PlanningErrorCode
from bestman_bt.manipulation.motion_planning.timed_planner import CollisionRecovery
from bestman_bt.messages import Box, PlacedShape, Pose
from tests.manipulation.motion_planning.joint_worlds import TWO, JointWorld
from tests.manipulation.table_and_shelf import FINGERS


def slab(height: float, thickness: float = 0.02, name: str = "slab") -> SceneObstacle:
    """A board in front of the arm, its upper side at ``height`` metres."""
    return SceneObstacle(name, (PlacedShape(Box((0.6, 0.6, thickness)), Pose([0.6, 0.0, height - thickness / 2])),))


def scene(*obstacles: SceneObstacle) -> PlanningScene:
    return PlanningScene(positions=FINGERS, obstacles=obstacles)


@pytest.fixture(scope="module")
def fingertips(collision_model, ready) -> float:
    """Metres: the highest board below the tool, which points down, that is no nearer than the padding; by bisection."""
    low, high = 0.2, 0.7
    while high - low > 1e-4:
        middle = (low + high) / 2
        free = collision_model.world(scene(slab(middle))).is_free(ready)
        low, high = (middle, high) if free else (low, middle)
    return low


def test_a_free_start_needs_no_motion(collision_model, arm, ready, rng) -> None:
    assert CollisionRecovery().path(ready, collision_model.world(scene()), arm, rng).tolist() == [ready.tolist()]


@pytest.mark.parametrize("overlap", [0.001, 0.006, 0.016])
def test_the_clearance_grows_from_step_to_step_until_the_arm_is_free(
    collision_model, arm, ready, rng, fingertips, overlap
) -> None:
    world = collision_model.world(scene(slab(fingertips + overlap)))
    assert not world.is_free(ready)
    path = CollisionRecovery().path(ready, world, arm, rng)
    clearances = [world.clearance(positions) for positions in path]
    assert all(after > before for before, after in pairwise(clearances))
    assert clearances[0] < 0.0 < clearances[-1]
    assert world.is_free(path[-1])
    assert np.abs(np.diff(path, axis=0)).max() <= 0.01 + 1e-9
    assert np.abs(path[-1] - path[0]).max() < 0.2
    assert (path >= arm.lower).all()
    assert (path <= arm.upper).all()


def test_the_same_generator_gives_the_same_way_out(collision_model, arm, ready, fingertips) -> None:
    world = collision_model.world(scene(slab(fingertips + 0.01)))
    first, second = (CollisionRecovery().path(ready, world, arm, np.random.default_rng(3)) for _ in range(2))
    assert first.tolist() == second.tolist()


def test_what_overlaps_too_far_is_refused_with_the_pair_and_the_depth(
    collision_model, arm, ready, rng, fingertips
) -> None:
    world = collision_model.world(scene(slab(fingertips + 0.08, thickness=0.3)))
    with pytest.raises(MotionPlanningError, match=r"slab.*mm, too far to move out of it") as caught:
        CollisionRecovery().path(ready, world, arm, rng)
    assert caught.value.code is PlanningErrorCode.START_IN_COLLISION


def test_a_hand_that_is_wedged_in_is_refused(collision_model, arm, ready, rng, kinematics) -> None:
    """Boards against all sides of the fingers: whatever frees one side presses on another."""
    tool = kinematics.tool_pose(ready).position
    walls = []
    for k, (x, y) in enumerate([(1, 0), (-1, 0), (0, 1), (0, -1)]):
        offset = np.array([x * (0.009 + 0.05), y * (0.052 + 0.05), 0.02])
        walls.append(SceneObstacle(f"wall{k}", (PlacedShape(Box((0.1, 0.1, 0.2)), Pose(tool + offset)),)))
    world = collision_model.world(scene(*walls))
    assert not world.is_free(ready)
    with pytest.raises(MotionPlanningError, match="lead out of it|too far"):
        CollisionRecovery(largest_motion=0.05).path(ready, world, arm, rng)


class Slope(JointWorld):
    """The clearance of a joint a, metres; free where it is above 0."""

    def __init__(self, clearance):
        super().__init__(lambda q: clearance(q) > 0.0)
        self._clearance = clearance

    def clearance(self, positions):
        return float(self._clearance(np.asarray(positions)))


def out_of(world, start, rng, **changes):
    return CollisionRecovery(**changes).path(np.array(start), world, TWO, rng)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_it_climbs_the_clearance_with_full_steps_until_there_is_some_to_spare(rng, direction) -> None:
    """At 0.1 m/rad from 5 mm of overlap to 2 mm of clearance: 0.07 rad, in steps of 0.01."""
    path = out_of(Slope(lambda q: 0.1 * direction * q[0] - 0.005), [0.0, 0.0], rng)
    assert path[:, 0] == pytest.approx(direction * np.linspace(0.0, 0.07, 8), abs=1e-3)
    assert path[:, 1] == pytest.approx(0.0, abs=1e-6)


def test_only_a_shallow_overlap_is_left_and_only_by_a_small_motion(rng) -> None:
    steep = Slope(lambda q: q[0] - 0.029)
    assert out_of(steep, [0.0, 0.0], rng)[-1, 0] == pytest.approx(0.031, abs=0.011)
    with pytest.raises(MotionPlanningError, match="by 31 mm, too far"):
        out_of(Slope(lambda q: q[0] - 0.031), [0.0, 0.0], rng)
    for direction in (1.0, -1.0):
        with pytest.raises(MotionPlanningError, match=r"0\.35 rad of motion do not lead out"):
            out_of(Slope(lambda q, direction=direction: 0.05 * direction * q[0] - 0.02), [0.0, 0.0], rng)


def test_where_clearance_grows_by_less_than_a_step_the_steps_get_smaller(rng) -> None:
    """The clearance peaks 4 mrad away: a full step would pass the peak and lose."""
    peak = Slope(lambda q: 0.0005 - abs(q[0] - 0.004))
    path = out_of(peak, [0.0, 0.0], rng, directions=1)
    assert len(path) >= 2
    assert np.all(np.diff([peak.clearance(q) for q in path]) > 0.0)
    assert peak.is_free(path[-1])


def test_a_start_in_a_saddle_gets_out_by_chance_or_not_at_all(rng) -> None:
    """The gradient is nil; to both sides the clearance grows."""
    saddle = Slope(lambda q: q[0] ** 2 * 100 - 0.001 - 0.01 * abs(q[1]))
    path = out_of(saddle, [0.0, 0.0], rng)
    assert saddle.is_free(path[-1])
    with pytest.raises(MotionPlanningError, match="no small motion leads out of it"):
        out_of(Slope(lambda q: -0.001 - abs(q[0]) - abs(q[1])), [0.0, 0.0], rng)


def test_no_joint_is_moved_beyond_its_limit_nor_farther_beyond_it(rng) -> None:
    """b counts little, a is at its upper limit, or a hair beyond."""
    world = Slope(lambda q: 0.1 * (q[0] - 2.0) + 0.02 * q[1] - 0.003)
    for start in (2.0, 2.005):
        path = out_of(world, [start, 0.0], rng)
        assert world.is_free(path[-1])
        assert np.all(path[:, 0] <= start + 1e-12)
        assert path[-1, 1] > 0.1
    below = Slope(lambda q: -0.1 * (q[0] + 2.0) + 0.02 * q[1] - 0.003)
    assert np.all(out_of(below, [-2.005, 0.0], rng)[:, 0] >= -2.005 - 1e-12)


def test_nan_and_wrong_dimensions_are_refused(collision_model, arm, ready, rng) -> None:
    world = collision_model.world(scene())
    for start in (np.full(7, np.nan), ready[:6]):
        with pytest.raises(ManipulationError, match="start of a collision recovery"):
            CollisionRecovery().path(start, world, arm, rng)
