from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.rendered_table import known_models, solid, tumbler
from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose, Sphere
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.model_surface import model_surface, sample_shape


def test_samples_of_a_box_lie_on_its_faces_with_outward_normals() -> None:
    points, normals = sample_shape(Box((0.04, 0.06, 0.10)), 0.004)
    np.testing.assert_allclose(np.abs(points / [0.02, 0.03, 0.05]).max(axis=1), 1.0, atol=1e-9)
    assert ((points * normals).sum(axis=1) > 0).all()


def test_samples_of_a_ball_lie_on_it() -> None:
    points, normals = sample_shape(Sphere(0.03), 0.004)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 0.03, atol=1e-9)
    np.testing.assert_allclose(points, 0.03 * normals, atol=1e-12)


@pytest.mark.parametrize("shape", [Box((0.04, 0.06, 0.1)), Cylinder(0.033, 0.1), Sphere(0.03), tumbler()])
def test_samples_leave_no_gap_wider_than_twice_the_spacing(shape: object) -> None:
    coarse, _ = sample_shape(shape, 0.004)
    fine, _ = sample_shape(shape, 0.001)
    assert cKDTree(coarse).query(fine)[0].max() < 0.008


def test_normals_inside_a_tumbler_point_to_its_axis() -> None:
    points, normals = sample_shape(tumbler(), 0.004)
    radii = np.hypot(points[:, 0], points[:, 1])
    inner_wall = (radii < 0.0315) & (np.abs(normals[:, 2]) < 0.1)
    assert inner_wall.sum() > 100
    assert ((points * normals)[inner_wall, :2].sum(axis=1) < 0).all()


def test_the_grid_finds_the_nearest_sample_up_to_its_cell() -> None:
    surface = model_surface(known_models()[0], Pose(), 0.003)
    rng = np.random.default_rng(0)
    points = surface.points[rng.integers(len(surface.points), size=500)] + rng.normal(0.0, 0.006, (500, 3))
    found = np.linalg.norm(points - surface.points[surface.nearest_samples(points)], axis=1)
    best = cKDTree(surface.points).query(points)[0]
    assert (found - best).max() < 2 * math.sqrt(3) * surface.cell


def test_a_model_rests_on_the_plane_in_each_orientation() -> None:
    box = solid("box", Box((0.04, 0.06, 0.10)), (1, 1, 1), 2)
    lying = model_surface(box, Pose.from_xyz_rpy((0, 0, 0), (math.pi / 2, 0, 0)), 0.003)
    assert lying.height == pytest.approx(0.06, abs=1e-9)
    np.testing.assert_allclose(lying.rest_from_object.position, [0, 0, 0.03], atol=1e-9)


def test_a_model_without_shapes_is_refused() -> None:
    with pytest.raises(PerceptionError, match="'ghost' has no shapes"):
        model_surface(ObjectModel("ghost", (1, 1, 1), 1.0, 0.5, ()), Pose(), 0.003)


def test_a_composed_model_is_sampled_in_all_parts() -> None:
    parts = (PlacedShape(Box((0.1, 0.1, 0.02)), Pose()), PlacedShape(Sphere(0.02), Pose(np.array([0, 0, 0.05]))))
    surface = model_surface(ObjectModel("lamp", (1, 1, 1), 1.0, 0.5, parts), Pose(), 0.004)
    assert surface.height == pytest.approx(0.08, abs=0.001)
