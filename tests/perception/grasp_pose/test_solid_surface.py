from __future__ import annotations

import numpy as np
import pytest

from benchmarks.rendered_table import tumbler
from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.model_based import solid_surface


def body(*parts: PlacedShape) -> ObjectModel:
    return ObjectModel("body", (1, 1, 1), 0.1, 0.8, parts)


TWO_BLOCKS = body(
    PlacedShape(Box((0.06, 0.04, 0.02)), Pose()), PlacedShape(Box((0.02, 0.04, 0.06)), Pose(np.array([0.04, 0.0, 0.0])))
)
TUMBLER = body(PlacedShape(tumbler(0.03), Pose()))


def test_faces_on_which_parts_touch_are_no_surface() -> None:
    surface = solid_surface(TWO_BLOCKS, 0.004)
    where_they_touch = np.abs(surface.points[:, 0] - 0.03) < 1e-6
    assert not np.any(where_they_touch & (np.abs(surface.points[:, 2]) < 0.009))
    assert np.any(where_they_touch & (np.abs(surface.points[:, 2]) > 0.011)), "above and below it is"


def test_a_ray_goes_on_through_parts_that_touch() -> None:
    end, normal = solid_surface(TWO_BLOCKS, 0.01).opposite(np.array([[-0.03, 0.003, 0.002]]), np.array([[1.0, 0, 0]]))
    np.testing.assert_allclose(end, [[0.05, 0.003, 0.002]], atol=1e-6)
    np.testing.assert_allclose(normal, [[1.0, 0.0, 0.0]], atol=1e-9)


def test_a_ray_through_a_wall_ends_behind_it_or_beyond_the_hollow() -> None:
    surface, outside, inward = solid_surface(TUMBLER, 0.01), np.array([[0.03, 0.0, 0.01]]), np.array([[-1.0, 0.0, 0.0]])
    outside = surface.points[[np.argmin(np.linalg.norm(surface.points - outside, axis=1))]]
    first, _ = surface.opposite(outside, inward)
    last, _ = surface.opposite(outside, inward, last=True)
    assert np.linalg.norm(first - outside) == pytest.approx(0.003, abs=5e-4)
    assert np.linalg.norm(last - outside) == pytest.approx(0.06, abs=2e-3)


def test_a_ray_that_starts_outside_has_no_end() -> None:
    end, _ = solid_surface(TWO_BLOCKS, 0.01).opposite(np.array([[-0.1, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]]))
    assert np.isnan(end).all()


def test_the_centre_of_mass_is_that_of_the_volumes() -> None:
    centre = solid_surface(TWO_BLOCKS, 0.01).centre_of_mass
    np.testing.assert_allclose(centre, [0.04 * 0.5, 0.0, 0.0], atol=1e-9)


def test_a_model_without_solid_parts_is_refused() -> None:
    with pytest.raises(PerceptionError, match="'body' has no collision shapes"):
        solid_surface(body(), 0.01)
