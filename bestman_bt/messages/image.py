"""Camera images with depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.frozen_array import frozen_array


@dataclass(frozen=True)
class CameraIntrinsics:
    """Pinhole model: sizes, focal lengths and principal point in pixels (pixel centres at whole numbers).

    ``distortion``: of the lens, OpenCV's (k1, k2, p1, p2, k3) or nothing; empty means an ideal or rectified image,
    which is all that algorithms accept: the sensor rectifies.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distortion) not in (0, 4, 5):
            raise ValueError(
                f"CameraIntrinsics distortion should be empty or k1, k2, p1, p2 and maybe k3, but is {self.distortion}"
            )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The (3, 3) camera matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class RGBDImage:
    """A registered colour and depth image.

    ``rgb``: (H, W, 3) uint8. ``depth``: (H, W) float32, metres along the optical axis, 0 where unknown.
    ``stamp``: seconds on the robot's clock. The optical frame has x right, y down, z forward.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    intrinsics: CameraIntrinsics
    stamp: float

    def __post_init__(self) -> None:
        size = (self.intrinsics.height, self.intrinsics.width)
        object.__setattr__(self, "rgb", frozen_array(self.rgb, (*size, 3), "RGBDImage rgb", np.uint8))
        object.__setattr__(self, "depth", frozen_array(self.depth, size, "RGBDImage depth", np.float32))

    def points(self) -> NDArray[np.float64]:
        """Organised points in the optical frame, (H, W, 3) metres; NaN where the depth is unknown.

        ValueError on an image of a lens with distortion: rectify it first.
        """
        k = self.intrinsics
        if k.distortion:
            raise ValueError(f"points of an image with distortion {k.distortion} were asked for; rectify it first")
        z = np.where(np.isfinite(self.depth) & (self.depth > 0), self.depth, np.nan).astype(np.float64)
        u, v = np.meshgrid(np.arange(k.width), np.arange(k.height))
        return np.stack([(u - k.cx) * z / k.fx, (v - k.cy) * z / k.fy, z], axis=-1)
