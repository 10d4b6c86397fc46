"""Lenses with distortion: how an ideal rendering of a slightly larger field becomes the image of a real lens.

Brown, "Decentering distortion of lenses", 1966, in the form and order of OpenCV: k1, k2, p1, p2, k3.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics
from hal.pybullet.client import SimulationError

MARGIN = 2
"""Pixels rendered beyond what the lens needs, for interpolation."""
LARGEST = 3.0
"""How many times wider than the image the ideal field may become; no lens that the model fits needs more."""
ITERATIONS = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-10)


class Lens:
    """``ideal``: the pinhole to render, wide enough for every pixel of the image that ``intrinsics`` describe.

    Raises SimulationError if the distortion cannot be inverted all over the image.
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
        """The (H, W, 3) image of an ideal rendering, interpolated."""
        return np.asarray(cv2.remap(ideal, self._columns, self._rows, cv2.INTER_LINEAR), dtype=np.uint8)

    def depth(self, ideal: NDArray[np.float64]) -> NDArray[np.float64]:
        """The (H, W) depth along the optical axis of an ideal one: that of the nearest pixel, so that edges stay."""
        return np.asarray(cv2.remap(ideal, self._columns, self._rows, cv2.INTER_NEAREST), dtype=np.float64)
