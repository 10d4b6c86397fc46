"""Out of a start in collision: a small motion with ever more clearance, or a refusal that says why."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from bestman_bt.manipulation.collision import PlanningScene, SceneObstacle
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.manipulation.motion_planning import EscapeParameters, PlanningError, PlanningErrorCode, escape_path
from bestman_bt.messages import Box, PlacedShape, Pose
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
    assert escape_path(ready, collision_model.world(scene()), arm, rng).tolist() == [ready.tolist()]


@pytest.mark.parametrize("overlap", [0.001, 0.006, 0.016])
def test_the_clearance_grows_from_step_to_step_until_the_arm_is_free(
    collision_model, arm, ready, rng, fingertips, overlap
) -> None:
    world = collision_model.world(scene(slab(fingertips + overlap)))
    assert not world.is_free(ready)
    path = escape_path(ready, world, arm, rng)
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
    first, second = (escape_path(ready, world, arm, np.random.default_rng(3)) for _ in range(2))
    assert first.tolist() == second.tolist()


def test_what_overlaps_too_far_is_refused_with_the_pair_and_the_depth(
    collision_model, arm, ready, rng, fingertips
) -> None:
    world = collision_model.world(scene(slab(fingertips + 0.08, thickness=0.3)))
    with pytest.raises(PlanningError, match=r"slab.*mm, too far to move out of it") as caught:
        escape_path(ready, world, arm, rng)
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
    with pytest.raises(PlanningError, match="lead out of it|too far"):
        escape_path(ready, world, arm, rng, EscapeParameters(largest_motion=0.05))


def test_nan_and_wrong_dimensions_are_refused(collision_model, arm, ready, rng) -> None:
    world = collision_model.world(scene())
    for start in (np.full(7, np.nan), ready[:6]):
        with pytest.raises(ManipulationError, match="start of an escape"):
            escape_path(start, world, arm, rng)
