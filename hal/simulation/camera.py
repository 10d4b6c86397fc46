"""Simulated RGB-D cameras: software rendering, a lens, and the errors of a structured-light sensor."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, Pose, RGBDImage
from bestman_bt.robot_model.sensor_parts import CameraPart
from hal.api import Camera
from hal.simulation.bodies import SimulationError, Viewpoint, among
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.robot import SimulatedRobot
from hal.simulation.sensor_pipeline import SensorFault, SimulatedSensor
from hal.simulation.simulation import Simulation


class ScenePhotographer:
    """Takes pictures with shadows. Like GroundTruth, construct it before the first step, or it counts as untrusted."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._reader = robot.simulation.reader(ReadPurpose.RECORDING)
        self._built = robot.simulation.built

    def visible(self, viewpoint: Viewpoint, name: str, width: int = 160, height: int = 120) -> tuple[float, float]:
        """Return the fractions, 0 to 1, of a small picture that show an object and the robot."""
        bodies, _ = self._reader.segments(viewpoint, width, height)
        thing = among(self._built.objects, name, "object")
        return float(np.mean(bodies == thing)), float(np.mean(bodies == self._built.robot))

    def picture(
        self, viewpoint: Viewpoint, width: int = 960, height: int = 720, oversampling: int = 2
    ) -> NDArray[np.uint8]:
        """Render a picture (height, width, 3) uint8, antialiased by rendering ``oversampling`` times larger."""
        return smooth(self._reader.photo(viewpoint, width * oversampling, height * oversampling), oversampling)


def smooth(rgb: NDArray[np.uint8], oversampling: int) -> NDArray[np.uint8]:
    """Return an image (H, W, 3) downsampled by ``oversampling``, as means of its pixels."""
    height, width = rgb.shape[0] // oversampling, rgb.shape[1] // oversampling
    blocks = rgb.astype(np.float64).reshape(height, oversampling, width, oversampling, 3).mean(axis=(1, 3))
    picture: NDArray[np.uint8] = np.round(blocks).astype(np.uint8)
    return picture


EDGE_CURVATURE = 0.03
NEIGHBOURS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
MOVED = 5e-4
"""Smallest motion of a camera between an image and its rendering that is taken into account, metres or radians."""


@dataclass(frozen=True, eq=False)
class Exposure:
    """When and from where an image was taken; ``map_from_optical`` is the true pose, used only for rendering."""

    map_from_optical: Pose
    stamp: float


class SimulatedCamera(SimulatedSensor[Exposure], Camera):
    """Renders on request. With a latency, it takes images at its rate and returns the latest one available.

    Only requested images are rendered: objects moving in front of the camera are drawn at their current pose, up to a
    latency and a frame later than the stamp. The camera's own pose is that of the stamp. If it has moved since, the
    robot's own body, which moves along, has no depth.
    """

    def __init__(self, name: str, model: CameraPart, rng: np.random.Generator) -> None:
        super().__init__(name, model.rate, model.latency, on_demand=True)
        self._model, self._rng = model, rng
        self.intrinsics, self.optical_frame = model.intrinsics, model.optical_frame
        self._reader: Reader | None = None
        self._here: Callable[[], Pose] = Pose
        self._robot = -1
        self._rendered: tuple[Exposure, SensorFault | None, RGBDImage] | None = None

    def capture(self) -> RGBDImage:
        """Render colour and depth, and add the depth errors of the model."""
        capture, fault = super().read(), self.fault
        if self._rendered is not None:
            shown, shown_fault, image = self._rendered
            if shown is capture and fault in (shown_fault, SensorFault.FROZEN):
                return image
        image = self._render(capture)
        self._rendered = capture, fault, image
        return image

    def read(self) -> Any:
        """Return an image, like ``capture``."""
        return self.capture()

    def begin(self, simulation: Simulation) -> Callable[[], Exposure]:
        """Start rendering images of this simulation."""
        reader = self._reader = simulation.reader(ReadPurpose.SENSOR)
        self._rendered, self._robot = None, simulation.built.robot
        self._here = lambda: simulation.link_pose(reader, self.optical_frame)
        return lambda: Exposure(self._here(), simulation.now)

    def _render(self, capture: Exposure) -> RGBDImage:
        assert self._reader is not None
        model = self._model
        taken, here = capture.map_from_optical, self._here()
        moved = not np.allclose(taken.matrix, here.matrix, atol=MOVED)
        rgb, depth = self._seen(self._reader, taken, self._robot if moved else -1)
        noisy = spoil_depth(depth, model, self._rng)
        if self.fault is SensorFault.BLACK:
            rgb = np.zeros_like(rgb)
        if self.fault in (SensorFault.BLACK, SensorFault.NO_DEPTH):
            noisy = np.zeros_like(noisy)
        return RGBDImage(rgb, noisy, model.intrinsics, capture.stamp)

    @cached_property
    def _lens(self) -> Lens | None:
        return Lens(self._model.intrinsics) if any(self._model.intrinsics.distortion) else None

    def _seen(self, reader: Reader, taken: Pose, without: int) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        model, lens = self._model, self._lens
        ideal = model.intrinsics if lens is None else lens.ideal
        rgb, depth = reader.depth_image(taken, ideal, model.near, model.far, without)
        return (rgb, depth) if lens is None else (lens.color(rgb), lens.depth(depth))


def spoil_depth(depth: NDArray[np.float64], model: CameraPart, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return depth (H, W), metres, with systematic error, noise that grows with the squared distance, holes at edges
    and at random, and quantisation.
    """
    deviation = model.noise_base + model.noise_quadratic * np.clip(depth - 0.4, 0.0, None) ** 2
    noisy = model.depth_scale * depth + model.depth_offset + rng.standard_normal(depth.shape) * deviation
    curved = np.abs(cv2.Laplacian(depth, cv2.CV_64F, borderType=cv2.BORDER_REFLECT)) > EDGE_CURVATURE
    edges = cv2.dilate(curved.view(np.uint8), NEIGHBOURS) > 0
    holes = rng.random(depth.shape) < np.where(edges, model.edge_dropout, model.dropout)
    noisy[holes | (depth <= 0.0)] = 0.0
    if model.depth_step > 0.0:
        noisy = np.round(noisy / model.depth_step) * model.depth_step
    return np.clip(noisy, 0.0, None).astype(np.float32)


MARGIN = 2
"""Margin of pixels rendered beyond those that the lens needs, for interpolation."""
LARGEST = 3.0
"""Largest width of the ideal image relative to the real one; no lens that the model fits needs more."""
ITERATIONS = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-10)


class Lens:
    """Lens distortion. ``ideal``: the pinhole to render, wide enough for every pixel of the image of ``intrinsics``.

    D. Brown, "Decentering distortion of lenses", 1966, in the form and order of OpenCV: k1, k2, p1, p2, k3. Raises
    SimulationError if the distortion cannot be inverted in the whole image.
    """

    def __init__(self, intrinsics: CameraIntrinsics) -> None:
        k = intrinsics
        u, v = np.meshgrid(np.arange(k.width, dtype=float), np.arange(k.height, dtype=float))
        pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
        distortion = np.array(k.distortion)
        rays = cv2.undistortPoints(pixels, k.matrix, distortion, criteria=ITERATIONS)
        back, _ = cv2.projectPoints(
            np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1), np.zeros(3), np.zeros(3), k.matrix, distortion
        )
        sources = rays.reshape(k.height, k.width, 2) * (k.fx, k.fy) + (k.cx, k.cy)
        lower = np.floor(sources.min(axis=(0, 1))) - MARGIN
        size = np.ceil(sources.max(axis=(0, 1))) + MARGIN + 1 - lower
        invertible = np.isfinite(back).all() and np.abs(back - pixels).max() < 0.01
        if not invertible or not (size < (LARGEST * k.width, LARGEST * k.height)).all():
            raise SimulationError(
                f"the lens distortion {k.distortion} folds the image of {k.width} × {k.height} pixels; "
                "coefficients k1, k2, p1, p2, k3 of a real lens are expected"
            )
        width, height = (math.ceil(extent) for extent in size)
        self.ideal = CameraIntrinsics(width, height, k.fx, k.fy, k.cx - float(lower[0]), k.cy - float(lower[1]))
        self._columns, self._rows = np.moveaxis((sources - lower).astype(np.float32), -1, 0)

    def color(self, ideal: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the (H, W, 3) image of an ideal rendering, interpolated."""
        return np.asarray(cv2.remap(ideal, self._columns, self._rows, cv2.INTER_LINEAR), dtype=np.uint8)

    def depth(self, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distorted depth (H, W) of an ideal one, metres along the optical axis, by nearest pixel to keep
        edges.
        """
        return np.asarray(cv2.remap(ideal, self._columns, self._rows, cv2.INTER_NEAREST), dtype=np.float64)
