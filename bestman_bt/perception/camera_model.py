"""Rectification: from the image of a lens with distortion to that of an ideal pinhole, so that algorithms need no other
model.

Brown, "Decentering distortion of lenses", 1966, in the form and order of OpenCV: k1, k2, p1, p2, k3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, RGBDImage
from bestman_bt.perception.errors import PerceptionError


@dataclass(frozen=True)
class DepthCorrection:
    """Linear depth error: the sensor measures ``scale * z + offset`` at a depth of z; ``offset`` in metres."""

    scale: float = 1.0
    offset: float = 0.0

    def apply(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return corrected depths (H, W) of measured ones, metres; 0 where the measurement is missing or invalid."""
        if self == DepthCorrection():
            return depth
        corrected = (depth - np.float32(self.offset)) / np.float32(self.scale)
        return np.where((depth > 0.0) & (corrected > 0.0), corrected, np.float32(0.0))


class Rectification:
    """Maps images of one camera to those of an ideal pinhole; the map is computed once.

    The ideal image has the size, the focal lengths and the principal point of the real one; pixels outside the lens's
    view are black and have no depth.
    """

    def __init__(self, intrinsics: CameraIntrinsics) -> None:
        self._intrinsics = intrinsics
        self.ideal = replace(intrinsics, distortion=())
        matrix, size = intrinsics.matrix, (intrinsics.width, intrinsics.height)
        self._columns, self._rows = cv2.initUndistortRectifyMap(
            matrix, np.array(intrinsics.distortion), np.eye(3), matrix, size, cv2.CV_32FC1
        )

    def apply(self, image: RGBDImage) -> RGBDImage:
        """Return the ideal image: colour interpolated, depth of the nearest pixel, so that edges stay sharp. Raises
        PerceptionError if the image is not from this camera.
        """
        if image.intrinsics != self._intrinsics:
            raise PerceptionError(f"an image with {image.intrinsics} cannot be rectified by {self._intrinsics}")
        rgb = cv2.remap(image.rgb, self._columns, self._rows, cv2.INTER_LINEAR)
        depth = cv2.remap(image.depth, self._columns, self._rows, cv2.INTER_NEAREST)
        return RGBDImage(np.asarray(rgb, np.uint8), np.asarray(depth, np.float32), self.ideal, image.stamp)


@lru_cache(maxsize=8)
def rectification(intrinsics: CameraIntrinsics) -> Rectification | None:
    """Return the rectification of a camera, cached, or None if the camera has no distortion."""
    return Rectification(intrinsics) if any(intrinsics.distortion) else None
