from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable
from bestman_bt.messages import Box, PlacedShape, Pose, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspTarget
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from examples.plugins.bounding_box_grasps import BoundingBox
from tests.robot_models import gripper_model

GRIPPER = gripper_model(finger_depth=0.045, pad_size=(0.02, 0.02))


def box(*size: float) -> GraspTarget:
    return GraspTarget(PlacedShape(Box(size), Pose.from_xyz_rpy((0.5, 0.0, size[2] / 2), (0.0, 0.0, 0.7))))


def test_it_closes_across_the_smaller_side_first() -> None:
    candidates = BoundingBox().plan(box(0.07, 0.04, 0.1), GRIPPER, 0.0)
    assert [candidate.width for candidate in candidates] == [0.04, 0.04, 0.07, 0.07]
    closing = candidates[0].grasp.rotation[:, 1]
    expected = Pose.from_xyz_rpy((0, 0, 0), (0, 0, 0.7)).rotation[:, 1]
    assert abs(closing @ expected) == pytest.approx(1.0)


def test_it_goes_thirty_millimetres_deep_at_most() -> None:
    deep, flat = (BoundingBox().plan(box(*size), GRIPPER, 0.0) for size in ((0.07, 0.04, 0.1), (0.04, 0.04, 0.03)))
    assert (len(deep), len(flat)) == (4, 4)
    for candidate in deep:
        assert candidate.grasp.position[2] == pytest.approx(0.07)
    for candidate in flat:
        assert candidate.grasp.position[2] == pytest.approx(GRIPPER.part.pad_size[1] / 2 + 0.006)


def test_what_does_not_fit_between_the_fingers_has_no_grasp() -> None:
    assert BoundingBox().plan(box(0.09, 0.075, 0.1), GRIPPER, 0.0) == ()


def test_a_size_at_the_limit_of_the_opening_is_still_taken() -> None:
    (candidate, _) = BoundingBox().plan(box(0.2, 0.0729, 0.1), GRIPPER, 0.0)
    assert candidate.opening == pytest.approx(0.08)
    assert BoundingBox().plan(box(0.2, 0.0731, 0.1), GRIPPER, 0.0) == ()


def test_with_something_beside_the_middle_it_takes_the_ends() -> None:
    target = box(0.12, 0.04, 0.1)
    beside = target.box.pose.apply(np.array([[0.0, 0.04, 0.03], [0.0, -0.04, 0.03]]))
    candidates = BoundingBox().plan(replace(target, surroundings=beside), GRIPPER, 0.0)
    along = {round(float(target.box.pose.inverse().apply(c.grasp.position[None])[0, 0]), 3) for c in candidates}
    assert along == {-0.025, 0.025}
    assert all(candidate.clearance >= 0.004 for candidate in candidates)


def test_with_something_all_around_there_is_no_grasp() -> None:
    target = box(0.12, 0.04, 0.1)
    fence = target.box.pose.apply(np.array([[x, y, 0.05] for x in np.linspace(-0.06, 0.06, 25) for y in (-0.03, 0.03)]))
    assert BoundingBox().plan(replace(target, surroundings=fence), GRIPPER, 0.0) == ()


@pytest.mark.parametrize("size", [(0.0, 0.04, 0.1), (0.04, float("nan"), 0.1)])
def test_a_box_without_a_size_is_refused(size: tuple[float, float, float]) -> None:
    with pytest.raises(PerceptionError, match="should have a finite size above 0"):
        BoundingBox().plan(GraspTarget(PlacedShape(Box(size), Pose())), GRIPPER, 0.0)


def test_a_target_with_another_shape_is_refused() -> None:
    with pytest.raises(PerceptionError, match="should be a Box but is Sphere"):
        BoundingBox().plan(GraspTarget(PlacedShape(Sphere(0.03), Pose())), GRIPPER, 0.0)


def test_an_unknown_thing_in_an_image_is_grasped_across_its_middle(table: Callable[..., RenderedTable]) -> None:
    scene = table(40, known=0, unknown=3)
    small = [item for item in scene.objects if min(item.model.size[:2]) < 0.06 and item.model.size[2] > 0.05]
    assert small
    clusters = PlaneDbscan().segment(scene.view, scene.region, np.random.default_rng(0)).clusters
    for item in small:
        cluster = min(clusters, key=lambda c: np.linalg.norm(c.bounding_box.pose.position - item.pose.position))
        height = cluster.plane.height_at(*item.pose.position[:2])
        best = BoundingBox().plan(GraspTarget.of_cluster(cluster), GRIPPER, height)[0]
        assert np.linalg.norm((best.grasp.position - item.pose.position)[:2]) < 0.008
        assert best.opening > min(item.model.size[:2])
