from __future__ import annotations

import math
import time

import numpy as np
import pytest

from benchmarks.rendered_table import solid
from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, PointCloud, Pose, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.antipodal_cloud import AntipodalCloud
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from tests.robot_models import gripper_model

GRIPPER = gripper_model(finger_depth=0.039, pad_size=(0.02, 0.02))
SUPPORT = 0.75
EYE = np.array([-0.2, 0.0, 1.65])
BRICK = solid("brick", Box((0.12, 0.035, 0.06)), (1, 1, 1), 2)


def seen(
    model: ObjectModel, noise: float = 0.002, yaw: float = 0.4, count: int = 2000, eye: np.ndarray = EYE
) -> GraspTarget:
    """What a camera at ``eye`` measures of a convex model on the table, noisy along its rays."""
    rng = np.random.default_rng(5)
    pose = Pose.from_xyz_rpy((0.6, 0.1, SUPPORT + model.size[2] / 2), (0.0, 0.0, yaw))
    points, normals = sample_shape(model.collision[0].shape, 0.002)
    points, normals = pose.apply(points), normals @ pose.rotation.T
    rays = points - eye
    ranges = np.linalg.norm(rays, axis=1)
    visible = np.flatnonzero(np.einsum("ij,ij->i", normals, rays) < -0.1 * ranges)
    chosen = rng.permutation(visible)[:count]
    measured = points[chosen] * (1 + rng.normal(0.0, noise, (len(chosen), 1)) / ranges[chosen, None])
    measured += eye * (1 - measured / points[chosen])
    return GraspTarget(PlacedShape(Box(tuple(model.size)), pose), cloud=PointCloud(measured), viewpoints=eye[None])


def plan(target: GraspTarget) -> tuple[GraspCandidate, ...]:
    return AntipodalCloud().plan(target, GRIPPER, SUPPORT)


@pytest.fixture(scope="module")
def of_brick() -> tuple[GraspTarget, tuple[GraspCandidate, ...]]:
    target = seen(BRICK)
    return target, plan(target)


def test_the_best_grasp_closes_across_the_narrow_side_at_the_middle(of_brick) -> None:
    target, candidates = of_brick
    best, pose = candidates[0], target.box.pose
    assert abs(best.grasp.rotation[:, 1] @ pose.rotation[:, 1]) > math.cos(math.radians(8))
    assert np.linalg.norm((best.grasp.position - pose.position)[:2]) < 0.012
    assert best.width == pytest.approx(0.035, abs=0.008)
    assert best.approach == "top"


def test_each_hand_stays_above_the_table_and_off_the_thing(of_brick) -> None:
    target, candidates = of_brick
    truth = target.box.pose.apply(sample_shape(BRICK.collision[0].shape, 0.004)[0])
    for candidate in candidates:
        local = candidate.grasp.inverse().apply(truth)
        beside = (np.abs(local[:, 0]) < 0.01) & (np.abs(local[:, 2] + 0.015) < 0.025)
        fingers = (
            beside
            & (np.abs(local[:, 1]) > candidate.opening / 2)
            & (np.abs(local[:, 1]) < candidate.opening / 2 + 0.024)
        )
        assert not fingers.any()
        assert candidate.clearance >= 0.006 - 1e-6
        assert candidate.width < candidate.opening <= GRIPPER.max_width


def test_grasps_are_sorted_and_different(of_brick) -> None:
    _, candidates = of_brick
    qualities = [candidate.quality for candidate in candidates]
    assert qualities == sorted(qualities, reverse=True)
    assert len(candidates) > 5


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    "model", [solid("ball", Sphere(0.03), (1, 1, 1), 0), solid("tube", Cylinder(0.025, 0.12), (1, 1, 1), 0)]
)
def test_a_round_thing_is_taken_across_its_middle_though_its_far_side_is_hidden(model: ObjectModel) -> None:
    target = seen(model)
    best = plan(target)[0]
    offset = (best.grasp.position - target.box.pose.position)[:2]
    assert np.linalg.norm(offset) < 0.010
    assert best.opening > float(model.size[0])


def test_a_neighbour_close_by_turns_or_shifts_the_grasp() -> None:
    target = seen(BRICK)
    best = plan(target)[0]
    beside = target.box.pose.apply(np.array([[x, y, 0.0] for x in (-0.02, 0.0, 0.02) for y in (-0.035, 0.035)]))
    crowded = GraspTarget(target.box, cloud=target.cloud, viewpoints=target.viewpoints, surroundings=beside)
    others = plan(crowded)
    assert len(others) > 3
    for candidate in others:
        moved = np.linalg.norm(candidate.grasp.position - best.grasp.position)
        turned = abs(candidate.grasp.rotation[:, 1] @ best.grasp.rotation[:, 1])
        assert moved > 0.01 or turned < math.cos(math.radians(25))
        fingers = candidate.grasp.apply(
            np.array([[0.0, y, 0.0] for y in (-candidate.opening / 2, candidate.opening / 2)])
        )
        assert np.linalg.norm(fingers[:, None] - beside[None], axis=2).min() > 0.005


def test_what_is_wider_than_the_hand_opens_has_no_grasp() -> None:
    assert plan(seen(solid("drum", Cylinder(0.06, 0.1), (1, 1, 1), 0))) == ()


def test_few_points_or_none_that_are_finite_give_no_grasp() -> None:
    box = seen(BRICK).box
    for points in (np.zeros((0, 3)), np.full((500, 3), np.nan), np.array([[0.6, 0.1, 0.8]] * 3)):
        assert plan(GraspTarget(box, cloud=PointCloud(points), viewpoints=EYE[None])) == ()


def test_points_that_are_not_finite_change_nothing(of_brick) -> None:
    target, candidates = of_brick
    dirty = PointCloud(np.concatenate([target.cloud.points, np.full((40, 3), np.nan), np.full((3, 3), np.inf)]))
    again = plan(GraspTarget(target.box, cloud=dirty, viewpoints=target.viewpoints))
    np.testing.assert_array_equal(again[0].grasp.matrix, candidates[0].grasp.matrix)


def test_a_target_without_a_cloud_is_refused() -> None:
    with pytest.raises(PerceptionError, match="needs a target with a cloud"):
        plan(GraspTarget(seen(BRICK).box))


def test_surroundings_of_another_shape_are_refused() -> None:
    target = seen(BRICK)
    with pytest.raises(PerceptionError, match=r"should be \(N, 3\) but are \(4, 2\)"):
        plan(GraspTarget(target.box, cloud=target.cloud, surroundings=np.zeros((4, 2))))


def test_equal_input_gives_equal_output_within_the_time(of_brick) -> None:
    target, candidates = of_brick
    start = time.process_time()
    again = plan(target)
    assert time.process_time() - start < 0.3
    for one, other in zip(candidates, again, strict=True):
        np.testing.assert_array_equal(one.grasp.matrix, other.grasp.matrix)
        assert one.quality == other.quality


def test_a_limb_of_a_thing_that_is_too_wide_is_taken() -> None:
    slab = sample_shape(Box((0.11, 0.11, 0.05)), 0.002)[0] + [0.0, 0.0, SUPPORT + 0.025]
    limb = sample_shape(Box((0.06, 0.025, 0.05)), 0.002)[0] + [0.08, 0.0, SUPPORT + 0.025]
    points = np.concatenate([slab, limb])
    target = GraspTarget(
        PlacedShape(Box((0.17, 0.11, 0.05)), Pose(np.array([0.03, 0, SUPPORT + 0.025]))), cloud=PointCloud(points)
    )
    best = plan(target)[0]
    assert best.width < 0.035
    assert best.grasp.position[0] > 0.055
