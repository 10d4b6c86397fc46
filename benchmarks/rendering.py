"""Rendered RGB-D images of scenes with known truth, and the noise of a structured-light camera.

PyBullet's TinyRenderer draws them; where PyBullet has no wheels, MuJoCo.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import Box, CameraIntrinsics, Cylinder, Mesh, PlacedShape, Pose, RGBDImage, Sphere
from bestman_bt.perception.view import View
from hal.pybullet.package import pybullet

Color = tuple[float, float, float]

WIDTH, HEIGHT, VERTICAL_FOV = 640, 480, math.radians(58.0)
NEAR, FAR = 0.05, 6.0


@dataclass(frozen=True)
class DepthNoise:
    """See bestman_bt.robot_model.sensor_parts.CameraPart; ``quantum``: metres between two depth values."""

    base: float = 0.0012
    quadratic: float = 0.0019
    edge_dropout: float = 0.7
    dropout: float = 0.005
    quantum: float = 0.001

    def apply(self, depth: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float32]:
        """Return a measured depth image for a true one."""
        noisy = depth + rng.normal(size=depth.shape) * (self.base + self.quadratic * np.clip(depth - 0.4, 0, None) ** 2)
        edges = cv2.dilate((np.abs(cv2.Laplacian(depth, cv2.CV_64F)) > 0.03).astype(np.uint8), np.ones((3, 3)))
        noisy[(edges > 0) & (rng.random(depth.shape) < self.edge_dropout)] = 0.0
        noisy[rng.random(depth.shape) < self.dropout] = 0.0
        noisy[depth > 5.0] = 0.0
        return (np.round(noisy / self.quantum) * self.quantum).astype(np.float32)


def render_view(
    parts: Sequence[tuple[PlacedShape, Color]],
    frame_from_camera: Pose,
    rng: np.random.Generator,
    noise: DepthNoise | None = None,
) -> View:
    """What a camera sees of coloured shapes, placed in the frame."""
    rgb, depth = (_by_pybullet if DEFAULT_SIMULATOR == "pybullet" else _by_mujoco)(parts, frame_from_camera)
    image = RGBDImage(rgb, (noise or DepthNoise()).apply(depth, rng), intrinsics(), 0.0)
    return View(image, frame_from_camera)


def occlusion(
    bodies: Sequence[Sequence[PlacedShape]], frame_from_camera: Pose, scale: float = 0.5
) -> NDArray[np.float64]:
    """The share (n,) of each body's pixels that the other bodies hide; 1 where it is not in the image at all.

    Each body is rendered alone and with all others, at ``scale`` times the size of the image.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        members = [[_draw(client, s.shape, s.pose, (0.5, 0.5, 0.5)) for s in body] for body in bodies]
        together = _mask(client, frame_from_camera, scale)
        for body in members:
            _move(client, body, away=True)
        shares = []
        for body in members:
            _move(client, body, away=False)
            alone = int(np.isin(_mask(client, frame_from_camera, scale), body).sum())
            _move(client, body, away=True)
            shares.append(1.0 - int(np.isin(together, body).sum()) / alone if alone else 1.0)
    finally:
        pybullet.disconnect(client)
    return np.clip(np.array(shares), 0.0, 1.0)


def intrinsics() -> CameraIntrinsics:
    """640 × 480 pixels, 58° vertical field of view.

    TinyRenderer samples at the corners of pixels, bottom row first: measured on a slanted plane, its principal point
    is (W/2, H/2 - 1) exactly; (W-1)/2, (H-1)/2 would shift all points by half a pixel, 1.7 mm at 1.5 m.
    """
    focal = HEIGHT / 2 / math.tan(VERTICAL_FOV / 2)
    return CameraIntrinsics(WIDTH, HEIGHT, focal, focal, WIDTH / 2, HEIGHT / 2 - 1)


def _draw(client: int, shape: Box | Cylinder | Sphere | Mesh, pose: Pose, color: Color) -> int:
    rgba = [*color, 1.0]
    match shape:
        case Box():
            half = [extent / 2 for extent in shape.size]
            visual = pybullet.createVisualShape(
                pybullet.GEOM_BOX, halfExtents=half, rgbaColor=rgba, physicsClientId=client
            )
        case Cylinder():
            visual = pybullet.createVisualShape(
                pybullet.GEOM_CYLINDER,
                radius=shape.radius,
                length=shape.length,
                rgbaColor=rgba,
                physicsClientId=client,
            )
        case Sphere():
            visual = pybullet.createVisualShape(
                pybullet.GEOM_SPHERE, radius=shape.radius, rgbaColor=rgba, physicsClientId=client
            )
        case Mesh():
            corners = shape.vertices[shape.faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            visual = pybullet.createVisualShape(
                pybullet.GEOM_MESH,
                vertices=corners.reshape(-1, 3).tolist(),
                indices=list(range(3 * len(corners))),
                normals=np.repeat(normals, 3, axis=0).tolist(),
                rgbaColor=rgba,
                physicsClientId=client,
            )
    body: int = pybullet.createMultiBody(
        0.0, -1, visual, pose.position.tolist(), pose.quaternion.tolist(), physicsClientId=client
    )
    return body


def _move(client: int, bodies: Sequence[int], away: bool) -> None:
    for body in bodies:
        position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        shifted = [position[0], position[1], position[2] + (-100.0 if away else 100.0)]
        pybullet.resetBasePositionAndOrientation(body, shifted, quaternion, physicsClientId=client)


def _mask(client: int, frame_from_camera: Pose, scale: float) -> NDArray[np.int64]:
    size = round(scale * WIDTH), round(scale * HEIGHT)
    return np.asarray(_camera_image(client, frame_from_camera, size)[4], dtype=np.int64).reshape(size[1], size[0])


def _camera_image(client: int, frame_from_camera: Pose, size: tuple[int, int]) -> tuple[object, ...]:
    rotation, eye = frame_from_camera.rotation, frame_from_camera.position
    view = pybullet.computeViewMatrix(eye.tolist(), (eye + rotation[:, 2]).tolist(), (-rotation[:, 1]).tolist())
    projection = pybullet.computeProjectionMatrixFOV(math.degrees(VERTICAL_FOV), WIDTH / HEIGHT, NEAR, FAR)
    image: tuple[object, ...] = pybullet.getCameraImage(
        *size, view, projection, shadow=0, renderer=pybullet.ER_TINY_RENDERER, physicsClientId=client
    )
    return image


def _by_pybullet(
    parts: Sequence[tuple[PlacedShape, Color]], frame_from_camera: Pose
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    client = pybullet.connect(pybullet.DIRECT)
    try:
        for placed, color in parts:
            _draw(client, placed.shape, placed.pose, color)
        _, _, rgba, buffer, _ = _camera_image(client, frame_from_camera, (WIDTH, HEIGHT))
    finally:
        pybullet.disconnect(client)
    rgb = np.reshape(np.asarray(rgba, dtype=np.uint8), (HEIGHT, WIDTH, 4))[..., :3]
    depth_buffer = np.reshape(np.asarray(buffer, dtype=np.float64), (HEIGHT, WIDTH))
    return np.ascontiguousarray(rgb), FAR * NEAR / (FAR - (FAR - NEAR) * depth_buffer)


def _by_mujoco(
    parts: Sequence[tuple[PlacedShape, Color]], frame_from_camera: Pose
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    from hal.mujoco.renderer import shown

    with shown(parts) as renderer:
        rgb, depth = renderer.pinhole(frame_from_camera, intrinsics(), NEAR, FAR)
    return np.ascontiguousarray(rgb), depth
