from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.perception.affordance.fronts import local_planes

CAMERA = CameraIntrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)


def depth_of_plane(normal: np.ndarray, distance: float) -> np.ndarray:
    """Depth image of the plane normal · p = distance, in the optical frame."""
    x = (np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx
    y = (np.arange(CAMERA.height) - CAMERA.cy) / CAMERA.fy
    rays = normal[0] * x[None, :] + normal[1] * y[:, None] + normal[2]
    return (distance / rays).astype(np.float32)


def test_a_slanted_plane_has_its_normal_everywhere() -> None:
    normal = np.array([0.4, -0.2, 0.8])
    normal /= np.linalg.norm(normal)
    planes = local_planes(depth_of_plane(normal, 1.2), CAMERA, 9, 4)
    assert planes.valid[1:-1, 1:-1].all()
    np.testing.assert_allclose(planes.normals[planes.valid] @ -normal, 1.0, atol=1e-4)
    np.testing.assert_allclose(planes.points[planes.valid] @ normal, 1.2, atol=1e-4)
    assert planes.residuals[planes.valid].max() < 1e-3


def test_a_step_in_depth_shows_in_the_residual() -> None:
    depth = np.full((48, 64), 1.0, dtype=np.float32)
    depth[:, 32:] = 1.2
    residuals = local_planes(depth, CAMERA, 9, 4).residuals
    assert residuals[6, 8] > 0.03
    assert residuals[6, 2] == pytest.approx(0.0, abs=1e-6)


def test_where_most_depth_is_missing_there_is_no_plane() -> None:
    depth = np.full((48, 64), 1.0, dtype=np.float32)
    depth[:, :32] = 0.0
    valid = local_planes(depth, CAMERA, 9, 4).valid
    assert not valid[:, :7].any()
    assert valid[2:-2, 9:].all()
