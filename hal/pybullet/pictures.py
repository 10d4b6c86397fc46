"""Images by PyBullet's software renderer, with its view and projection matrices."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, PlacedShape
from hal.pybullet.body_urdf import body_urdf
from hal.pybullet.client import PhysicsClient
from hal.pybullet.package import pybullet
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import smooth


def projection_matrix(k: CameraIntrinsics, near: float, far: float) -> list[float]:
    """Return the OpenGL projection (column-major) of a pinhole; TinyRenderer samples pixel (u, v) at (u, H - 1 - v)."""
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1] = 2.0 * k.fx / k.width, 2.0 * k.fy / k.height
    matrix[0, 2] = 1.0 - 2.0 * k.cx / k.width
    matrix[1, 2] = 2.0 * (k.cy + 1.0) / k.height - 1.0
    matrix[2, 2], matrix[2, 3] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
    matrix[3, 2] = -1.0
    values: list[float] = matrix.T.ravel().tolist()
    return values


def photo(client: PhysicsClient, viewpoint: Viewpoint, width: int, height: int) -> NDArray[np.uint8]:
    """Return a picture for people, (H, W, 3)."""
    image = client.getCameraImage(
        width,
        height,
        **view_matrices(viewpoint, width / height),
        shadow=1,
        lightDirection=viewpoint.light_direction,
        lightDistance=4.0,
        lightColor=[1.0, 0.98, 0.94],
        lightAmbientCoeff=0.55,
        lightDiffuseCoeff=0.45,
        lightSpecularCoeff=0.05,
        renderer=pybullet.ER_TINY_RENDERER,
    )
    return np.asarray(image[2], dtype=np.uint8).reshape(height, width, 4)[..., :3]


def view_matrices(viewpoint: Viewpoint, aspect: float) -> dict[str, Any]:
    """Return the arguments of ``getCameraImage``; ``aspect``: width by height."""
    return {
        "viewMatrix": pybullet.computeViewMatrix(viewpoint.eye, viewpoint.target, [0.0, 0.0, 1.0]),
        "projectionMatrix": pybullet.computeProjectionMatrixFOV(viewpoint.field_of_view, aspect, viewpoint.near, 30.0),
    }


def render_object(
    parts: Sequence[tuple[PlacedShape, tuple[float, float, float]]],
    viewpoint: Viewpoint,
    width: int = 480,
    height: int = 480,
) -> NDArray[np.uint8]:
    """Render shapes with their colours on white: (height, width, 3) uint8."""
    client = PhysicsClient()
    client.connect()
    try:
        with TemporaryDirectory() as folder:
            urdf = body_urdf("render_object", 0.0, (), [(part, (*color, 1.0)) for part, color in parts])
            file = Path(folder) / "render_object.urdf"
            file.write_text(urdf, encoding="utf-8")
            client.loadURDF(str(file), useFixedBase=True)
        return smooth(photo(client, viewpoint, 2 * width, 2 * height), 2)
    finally:
        client.disconnect()
