"""What a small reachability map answers, cell by cell, and what makes an arm's stored map another one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.reachability_map import ReachabilityMap, ReachabilitySampling, reachability_map
from bestman_bt.robot_model.model import ArmModel
from tests.manipulation.two_arms import two_arms
from tests.robot_models import with_limits

TINY = ReachabilitySampling(voxel=0.5, directions=4, samples=50)
AIMS = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
DOWN, FORWARD, UP = np.eye(3)[[2]] * -1, np.eye(3)[[0]], np.eye(3)[[2]]


@pytest.fixture
def small() -> ReachabilityMap:
    """4 x 4 x 4 voxels of 0.1 m from (1, 2, 3) on; voxel (1, 1, 1) is filled from above, (3, 1, 1) half as nimbly."""
    counts, nimble = np.zeros((4, 4, 4, 3), np.uint16), np.zeros((4, 4, 4, 3), np.float32)
    counts[1, 1, 1, 0], nimble[1, 1, 1, 0] = 6, 0.2
    counts[3, 1, 1, 0], nimble[3, 1, 1, 0] = 3, 0.1
    return ReachabilityMap(np.array([1.0, 2.0, 3.0]), 0.1, AIMS, counts, nimble, plenty=6)


def test_a_cell_scores_by_its_samples_and_by_how_nimble_the_arm_is(small) -> None:
    assert small.score([[1.15, 2.15, 3.15]], DOWN) == pytest.approx([1.0])
    assert small.score([[1.35, 2.15, 3.15]], DOWN) == pytest.approx([0.5 * 0.75])
    assert small.score([[1.15, 2.15, 3.15]], FORWARD) == pytest.approx([0.0])
    assert small.score([[1.15, 2.15, 3.15]], UP) == pytest.approx([0.0])


def test_between_voxels_and_between_directions_scores_are_shared(small) -> None:
    assert small.score([[1.175, 2.15, 3.15]], DOWN) == pytest.approx([0.75])
    assert small.score([[1.125, 2.15, 3.10]], DOWN) == pytest.approx([0.375])
    slanted = np.array([[0.6, 0.0, -0.8]])
    assert small.score([[1.15, 2.15, 3.15]], slanted) == pytest.approx([0.8 / 1.4])
    assert small.score([[0.99, 2.15, 3.15], [9.0, 9.0, 9.0]], np.repeat(DOWN, 2, axis=0)) == pytest.approx([0.0, 0.0])


@pytest.mark.slow
def test_many_samples_of_one_cell_are_counted_up_to_what_fits(kinematics, arm) -> None:
    one_cell = ReachabilitySampling(voxel=5.0, directions=1, samples=70_000)
    assert one_cell.build(kinematics, arm).counts.tolist() == [[[[65535]]]]
    few = replace(one_cell, samples=300)
    assert few.build(kinematics, arm).counts.sum() == 300


def test_whatever_moves_the_tool_or_bounds_the_arm_makes_another_map(tmp_path) -> None:
    robot = two_arms()
    left = robot.of(ArmModel)["left"]

    def with_arm(arm: ArmModel) -> DampedLeastSquares:
        return DampedLeastSquares(replace(robot, parts={**robot.parts, "left": arm}), "left")

    arms = [
        DampedLeastSquares(robot, "left"),
        DampedLeastSquares(robot, "right"),
        DampedLeastSquares(replace(robot, base_frame="root"), "left"),
        DampedLeastSquares(robot, "left", fixed={"right_lift": 0.1}),
        with_arm(replace(left, tool_frame="left_palm")),
        with_arm(with_limits(left, lower=left.lower + 0.01)),
        with_arm(with_limits(left, upper=left.upper - 0.01)),
    ]
    for number, arm in enumerate(arms, start=1):
        reachability_map(arm, arm.arm_model, TINY, tmp_path)
        assert len(list(tmp_path.iterdir())) == number
    for changed in (replace(TINY, seed=1), replace(TINY, plenty=3), replace(TINY, samples=51)):
        before = len(list(tmp_path.iterdir()))
        reachability_map(arms[0], arms[0].arm_model, changed, tmp_path)
        assert len(list(tmp_path.iterdir())) == before + 1


@pytest.mark.parametrize("shape", [(2, 2, 2), (9, 9, 9, 3)])
def test_a_stored_map_of_another_shape_is_built_anew(tmp_path, shape: tuple[int, ...]) -> None:
    arm = DampedLeastSquares(two_arms(), "left")
    built = reachability_map(arm, arm.arm_model, TINY, tmp_path)
    (file,) = tmp_path.iterdir()
    with np.load(file) as stored:
        values = dict(stored)
    np.savez(file, **{**values, "counts": np.ones(shape, np.uint16)})
    assert np.array_equal(reachability_map(arm, arm.arm_model, TINY, tmp_path).counts, built.counts)
