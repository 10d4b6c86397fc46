"""Third-person pictures of a scene, for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PlacedShape
from hal.pybullet.body_urdf import body_urdf
from hal.pybullet.client import PhysicsClient, Reader, ReadPurpose
from hal.pybullet.package import pybullet
from hal.pybullet.robot import PyBulletRobot


@dataclass(frozen=True)
class Viewpoint:
    """Where a picture is taken from: ``eye`` and ``target`` in the map frame, metres; vertical angle in degrees.

    ``near``: metres before which nothing is drawn.
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    field_of_view: float = 50.0
    light_direction: tuple[float, float, float] = (-2.0, -3.0, 6.0)
    near: float = 0.05


class ScenePhotographer:
    """Takes pictures with shadows. As GroundTruth, it has to be made before time runs to be trusted."""

    def __init__(self, robot: PyBulletRobot) -> None:
        self._reader = robot.simulation.client.reader(ReadPurpose.RECORDING)
        self._objects = robot.simulation.built.objects
        self._robot = robot.simulation.built.robot

    def visible(self, viewpoint: Viewpoint, name: str, width: int = 160, height: int = 120) -> tuple[float, float]:
        """Shares of a small picture that show an object and the robot."""
        view = pybullet.computeViewMatrix(viewpoint.eye, viewpoint.target, [0.0, 0.0, 1.0])
        projection = pybullet.computeProjectionMatrixFOV(viewpoint.field_of_view, width / height, 0.05, 30.0)
        image = self._reader.getCameraImage(
            width, height, viewMatrix=view, projectionMatrix=projection, shadow=0, renderer=pybullet.ER_TINY_RENDERER
        )
        bodies = np.asarray(image[4], dtype=np.int64).reshape(-1)
        return float(np.mean(bodies == self._objects[name])), float(np.mean(bodies == self._robot))

    def picture(
        self, viewpoint: Viewpoint, width: int = 960, height: int = 720, oversampling: int = 2
    ) -> NDArray[np.uint8]:
        """See smooth_picture."""
        return smooth_picture(self._reader, viewpoint, width, height, oversampling)


def smooth_picture(
    reader: Reader, viewpoint: Viewpoint, width: int, height: int, oversampling: int = 2
) -> NDArray[np.uint8]:
    """An (height, width, 3) uint8 picture, smoothed by rendering ``oversampling`` times larger."""
    across, down = width * oversampling, height * oversampling
    view = pybullet.computeViewMatrix(viewpoint.eye, viewpoint.target, [0.0, 0.0, 1.0])
    projection = pybullet.computeProjectionMatrixFOV(viewpoint.field_of_view, width / height, viewpoint.near, 30.0)
    image = reader.getCameraImage(
        across,
        down,
        viewMatrix=view,
        projectionMatrix=projection,
        shadow=1,
        lightDirection=viewpoint.light_direction,
        lightDistance=4.0,
        lightColor=[1.0, 0.98, 0.94],
        lightAmbientCoeff=0.55,
        lightDiffuseCoeff=0.45,
        lightSpecularCoeff=0.05,
        renderer=pybullet.ER_TINY_RENDERER,
    )
    rgb = np.asarray(image[2], dtype=np.uint8).reshape(down, across, 4)[..., :3].astype(np.float64)
    blocks = rgb.reshape(height, oversampling, width, oversampling, 3).mean(axis=(1, 3))
    picture: NDArray[np.uint8] = np.round(blocks).astype(np.uint8)
    return picture


def render_object(
    parts: Sequence[tuple[PlacedShape, tuple[float, float, float]]],
    viewpoint: Viewpoint,
    width: int = 480,
    height: int = 480,
) -> NDArray[np.uint8]:
    """Shapes and their colours before white: (height, width, 3) uint8."""
    client = PhysicsClient()
    client.connect()
    try:
        with TemporaryDirectory() as folder:
            urdf = body_urdf("render_object", 0.0, (), [(part, (*color, 1.0)) for part, color in parts], Path(folder))
            file = Path(folder) / "render_object.urdf"
            file.write_text(urdf, encoding="utf-8")
            client.loadURDF(str(file), useFixedBase=True)
        return smooth_picture(client.reader(ReadPurpose.RECORDING), viewpoint, width, height)
    finally:
        client.disconnect()
