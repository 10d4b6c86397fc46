from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.perception_measures.handle_scenes import HandleView, handle_view
from benchmarks.perception_measures.handles import Tally
from bestman_bt.messages import Handle, Pose


@pytest.fixture(scope="module")
def scenes() -> list[HandleView]:
    """Four frames, the last one without handles."""
    return [handle_view(seed) for seed in range(4)]


def tallied(scenes: list[HandleView], found: Callable[[HandleView], tuple[Handle, ...]]) -> dict[str, object]:
    tally = Tally()
    for frame, scene in enumerate(scenes):
        tally.milliseconds.append(1.0)
        tally.add(frame, scene, found(scene))
    return tally.report()


def moved(handle: Handle, shift: np.ndarray) -> Handle:
    return replace(handle, position_std=0.005, pose=Pose(handle.pose.position + shift, handle.pose.quaternion))


@pytest.mark.slow
def test_ground_truth_scores_the_maximum(scenes: list[HandleView]) -> None:
    report = tallied(scenes, lambda scene: tuple(moved(true.handle, np.zeros(3)) for true in scene.handles))
    assert report["handles"] == sum(true.counted for scene in scenes for true in scene.handles)
    assert report["handle_recall"] == report["handle_joint_rate"] == 1.0
    assert report["handle_false_positives_per_frame"] == 0.0
    assert report["handle_position_mm"] == 0.0


def test_finding_nothing_scores_nothing(scenes: list[HandleView]) -> None:
    report = tallied(scenes, lambda scene: ())
    assert report["handle_recall"] == 0.0
    assert report["handle_false_positives_per_frame"] == 0.0


def test_handles_that_are_elsewhere_are_missed_and_invented(scenes: list[HandleView]) -> None:
    off = np.array([0.0, 0.0, 3.0])
    report = tallied(scenes, lambda scene: tuple(moved(true.handle, off) for true in scene.handles))
    assert report["handle_recall"] == 0.0
    assert report["handle_false_positives_per_frame"] == sum(len(scene.handles) for scene in scenes) / len(scenes)


def test_the_same_handle_reported_twice_is_invented_once(scenes: list[HandleView]) -> None:
    def twice(scene: HandleView) -> tuple[Handle, ...]:
        once = tuple(moved(true.handle, np.zeros(3)) for true in scene.handles)
        return once + once

    report = tallied(scenes, twice)
    assert report["handle_recall"] == 1.0
    assert report["handle_false_positives_per_frame"] == sum(len(scene.handles) for scene in scenes) / len(scenes)


def test_a_scene_is_the_same_for_the_same_seed_and_every_fourth_has_no_handles(scenes: list[HandleView]) -> None:
    again = handle_view(1)
    np.testing.assert_array_equal(again.view.image.depth, scenes[1].view.image.depth)
    assert scenes[3].handles == ()
    assert any(true.counted for true in scenes[1].handles)
