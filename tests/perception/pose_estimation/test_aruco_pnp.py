from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception import PerceptionError
from bestman_bt.perception.pose_estimation import ArucoPnp

K = CameraIntrinsics(640, 480, 433.0, 433.0, 320.0, 239.0)
PNP = ArucoPnp()


def marker(distance: float, tilt: float, turn: float = 0.3) -> Pose:
    """camera_from_marker: it faces the camera, tilted by ``tilt`` about an axis in the image."""
    facing = Pose.from_xyz_rpy((0, 0, 0), (math.pi, 0, 0)) @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, turn))
    rotation = facing @ Pose.from_xyz_rpy((0, 0, 0), (tilt, 0, 0))
    return Pose(np.array([0.05, -0.03, distance]), rotation.quaternion)


def corners_of(camera_from_marker: Pose, size: float) -> np.ndarray:
    half = size / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    x, y, z = camera_from_marker.apply(square).T
    return np.stack([K.cx + K.fx * x / z, K.cy + K.fy * y / z], axis=1)


def depth_of(camera_from_marker: Pose, corners: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What a depth camera measures of the marker, and 0.3 m behind it of a wall."""
    u, v = np.meshgrid(np.arange(K.width), np.arange(K.height))
    rays = np.stack([(u - K.cx) / K.fx, (v - K.cy) / K.fy, np.ones(u.shape)], axis=-1)
    normal = camera_from_marker.rotation[:, 2]
    face = np.zeros(u.shape, np.uint8)
    cv2.fillConvexPoly(face, np.rint(corners).astype(np.int32), 1)
    wall = camera_from_marker.position[2] + 0.3
    depth = np.where(face > 0, (normal @ camera_from_marker.position) / (rays @ normal), wall)
    return (depth + rng.normal(0.0, 0.002, depth.shape)).astype(np.float32)


def angle(one: Pose, other: Pose) -> float:
    """Degrees between two rotations."""
    cosine = (np.trace(one.rotation.T @ other.rotation) - 1) / 2
    return math.degrees(math.acos(float(np.clip(cosine, -1, 1))))


@pytest.mark.parametrize("tilt", [0.2, 0.6, 1.0])
def test_exact_corners_give_the_exact_pose(tilt: float) -> None:
    true = marker(0.5, tilt)
    found = PNP.estimate(corners_of(true, 0.06), 0.06, K)
    np.testing.assert_allclose(found.camera_from_marker.position, true.position, atol=1e-5)
    assert angle(found.camera_from_marker, true) < 0.01
    assert found.reprojection_error < 1e-3


def test_a_small_far_marker_says_that_it_may_be_tilted_the_other_way() -> None:
    true = marker(1.2, 0.4)
    found = PNP.estimate(corners_of(true, 0.05), 0.05, K)
    assert found.ambiguous
    assert found.alternative is not None
    assert angle(found.alternative, found.camera_from_marker) > 20.0
    assert found.alternative_error < 0.5


def test_depth_rules_the_other_tilt_out() -> None:
    rng = np.random.default_rng(1)
    for tilt in (-0.5, -0.35, 0.35, 0.5):
        true = marker(1.0, tilt)
        exact = corners_of(true, 0.06)
        found = PNP.estimate(exact + rng.normal(0.0, 0.3, (4, 2)), 0.06, K, depth_of(true, exact, rng))
        assert not found.ambiguous
        assert angle(found.camera_from_marker, true) < 4.0
        assert np.linalg.norm(found.camera_from_marker.position - true.position) < 0.003
        assert found.depth_points >= 30


def test_unknown_depth_is_as_no_depth() -> None:
    corners = corners_of(marker(0.6, 0.5), 0.06)
    without = PNP.estimate(corners, 0.06, K)
    blind = PNP.estimate(corners, 0.06, K, np.full((480, 640), np.nan, np.float32))
    assert blind.depth_points == 0
    np.testing.assert_array_equal(without.camera_from_marker.matrix, blind.camera_from_marker.matrix)


def test_errors_are_as_large_as_the_covariance_says() -> None:
    rng = np.random.default_rng(0)
    squares = []
    for _ in range(60):
        true = marker(0.5, rng.uniform(0.5, 0.9), rng.uniform(-3.0, 3.0))
        found = PNP.estimate(corners_of(true, 0.08) + rng.normal(0.0, 0.4, (4, 2)), 0.08, K)
        turn = cv2.Rodrigues(found.camera_from_marker.rotation @ true.rotation.T)[0].ravel()
        error = np.concatenate([found.camera_from_marker.position - true.position, turn])
        squares.append(error @ np.linalg.solve(found.covariance, error))
    assert 3.0 < np.mean(squares) < 9.0
    assert np.mean(np.array(squares) < 12.59) > 0.85


@pytest.mark.parametrize(
    ("corners", "size", "message"),
    [
        (np.zeros((3, 2)), 0.05, "four finite pixels"),
        (np.full((4, 2), np.nan), 0.05, "four finite pixels"),
        (np.zeros((4, 2)), 0.05, "clockwise around a convex"),
        ([[0, 0], [0, 50], [50, 50], [50, 0]], 0.05, "clockwise around a convex"),
        ([[0, 0], [50, 0], [50, 50], [0, 50]], 0.0, "above 0 m"),
    ],
)
def test_corners_that_are_no_marker_are_refused(corners: object, size: float, message: str) -> None:
    with pytest.raises(PerceptionError, match=message):
        PNP.estimate(corners, size, K)


def test_images_that_are_not_rectified_or_of_another_shape_are_refused() -> None:
    corners = corners_of(marker(0.5, 0.3), 0.06)
    bent = CameraIntrinsics(640, 480, 433.0, 433.0, 320.0, 239.0, (0.1, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(PerceptionError, match="rectified"):
        PNP.estimate(corners, 0.06, bent)
    with pytest.raises(PerceptionError, match="shape of the image"):
        PNP.estimate(corners, 0.06, K, np.zeros((48, 64), np.float32))
