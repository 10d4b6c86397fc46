from __future__ import annotations

import numpy as np

from bestman_bt.manipulation.collision.planning_scene import PlanningScene, SceneObstacle
from bestman_bt.manipulation.trajectory.base import dense_samples, first_touch
from bestman_bt.manipulation.trajectory.toppra import Toppra
from bestman_bt.messages import Box, PlacedShape, Pose
from tests.manipulation.table_and_shelf import FINGERS


def test_the_first_touch_of_a_motion_has_its_time_and_pair(arm, kinematics, collision_model, ready):
    turned = ready.copy()
    turned[0] += 1.0
    middle = ready.copy()
    middle[0] += 0.5
    post = Box((0.01, 0.01, 2.0))
    scene = PlanningScene(
        FINGERS, (SceneObstacle("post", (PlacedShape(post, Pose(kinematics.tool_pose(middle).position)),)),)
    )
    trajectory = Toppra().parametrize([ready, turned], arm)
    touch = first_touch(trajectory, collision_model.world(scene))
    assert touch is not None
    assert 0.2 * trajectory.duration < touch.time < 0.5 * trajectory.duration
    assert all("post" in pair for pair in touch.pairs)
    assert str(touch).startswith(f"at {touch.time:.2f} s: panda_")
    assert first_touch(trajectory, collision_model.world(scene.without("post"))) is None


def test_samples_are_dense_in_time_and_in_space(arm, ready):
    trajectory = Toppra().parametrize([ready, ready + 0.3], arm)
    samples = list(dense_samples(trajectory, 0.01, 0.01))
    times = np.array([time for time, _ in samples])
    positions = np.array([q for _, q in samples])
    assert np.max(np.diff(times)) <= 0.01 + 1e-9
    assert np.max(np.linalg.norm(np.diff(positions, axis=0), axis=1)) <= 0.011
    assert times[-1] == trajectory.duration
