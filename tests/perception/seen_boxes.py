"""Depth images of boxes, computed by intersecting rays: exact, without a renderer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bestman_bt.messages import Box, CameraIntrinsics, PlacedShape, Pose, RGBDImage
from bestman_bt.perception.view import View

CAMERA = CameraIntrinsics(320, 240, 216.0, 216.0, 159.5, 119.5)


def looking_at(eye: Sequence[float], target: Sequence[float]) -> Pose:
    """The pose of an optical frame at ``eye``, upright."""
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    matrix[:3, 3] = eye
    return Pose.from_matrix(matrix)


def view_of(
    boxes: Sequence[PlacedShape],
    frame_from_camera: Pose,
    stamp: float = 0.0,
    rng: np.random.Generator | None = None,
    camera: CameraIntrinsics = CAMERA,
) -> View:
    """What the camera measures of the boxes, with 2 mm of noise where ``rng`` is given; 0 where it sees none."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
    depth = np.full(u.shape, np.inf)
    for placed in boxes:
        assert isinstance(placed.shape, Box)
        box_from_camera = placed.pose.inverse() @ frame_from_camera
        direction = rays @ box_from_camera.rotation.T
        with np.errstate(divide="ignore"):
            slabs = (np.array([[-0.5], [0.5]]) * placed.shape.size - box_from_camera.position)[
                :, None, None
            ] / direction
        near, far = slabs.min(axis=0).max(axis=-1), slabs.max(axis=0).min(axis=-1)
        depth = np.where((near < far) & (near > 0), np.minimum(depth, near), depth)
    if rng is not None:
        depth = depth + rng.normal(0.0, 0.002, depth.shape)
    known = np.where(np.isfinite(depth), depth, 0.0)
    rgb = np.full((camera.height, camera.width, 3), 128, dtype=np.uint8)
    return View(RGBDImage(rgb, known.astype(np.float32), camera, stamp), frame_from_camera)
