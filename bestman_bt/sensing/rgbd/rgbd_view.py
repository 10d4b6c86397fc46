"""An image together with where it was taken from, by encoders and forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import PointCloud, Pose, RGBDImage
from bestman_bt.perception import View


@dataclass(frozen=True, eq=False)
class RGBDView:
    """A rectified image, the camera's pose in the base frame, and the base's believed pose in the map at that time.

    ``own_body``: (H, W), True where a pixel shows the robot or what it holds; views leave these pixels out.
    """

    image: RGBDImage
    base_from_camera: Pose
    map_from_base: Pose
    own_body: NDArray[np.bool_]

    @property
    def stamp(self) -> float:
        """When the image was taken, seconds on the robot's clock."""
        return self.image.stamp

    @cached_property
    def _of_the_world(self) -> RGBDImage:
        depth = np.where(self.own_body, np.float32(0.0), self.image.depth)
        return RGBDImage(self.image.rgb, depth, self.image.intrinsics, self.image.stamp)

    @property
    def in_base(self) -> View:
        """The view in the base frame."""
        return View(self._of_the_world, self.base_from_camera)

    @property
    def in_map(self) -> View:
        """The view in the map frame, as good as the localisation."""
        return View(self._of_the_world, self.map_from_base @ self.base_from_camera)

    @cached_property
    def cloud(self) -> PointCloud:
        """The measured points in the base frame."""
        return self.in_base.cloud()
