"""What stands around the robot, known or seen, as a square of distances that rolls along.

As nav2's local costmap: that of the map and an ``ObstacleLayer``, measured by the exact Euclidean distance transform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.messages.bounds import Positive
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.distance_grid import DistanceGrid
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer

FAR = 10.0


@dataclass(eq=False)
class LocalObstacles(ObstacleLayer):
    """A layer of 6 m; ``distance``: to everything around, known or seen."""

    size: Annotated[Positive, "m"] = 6.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._mapped: NDArray[np.float32] = np.full((self._cells, self._cells), FAR, dtype=np.float32)
        self._tall: NDArray[np.float32] | None = None
        self.distance = DistanceGrid(self._mapped, (0.0, 0.0), self.resolution)

    def use_costmap(self, costmap: Costmap | None) -> None:
        """See ``ObstacleLayer.use_costmap``."""
        super().use_costmap(costmap)
        if self.origin is not None:
            self._rasterise_map(self.origin)
            self._measure()

    def centre_on(self, pose: Pose2D) -> None:
        """Make sure that the square lies around ``pose``."""
        before = self.origin
        super().centre_on(pose)
        if self.origin is not None and self.origin != before:
            self._rasterise_map(self.origin)
            self._measure()

    def update(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Take in a scan and where it was taken."""
        super().update(scan, map_from_lidar)
        self._measure()

    def _rasterise_map(self, origin: tuple[float, float]) -> None:
        if self._costmap is None:
            self._mapped, self._tall = np.full_like(self._mapped, FAR), None
            return
        along = (np.arange(self._mapped.shape[0]) + 0.5) * self.resolution
        x, y = np.meshgrid(origin[0] + along, origin[1] + along)
        middles, above = np.stack([x, y], axis=-1), self._costmap.above
        self._mapped = self._costmap.distance_at(middles).astype(np.float32)
        self._tall = None if above is None else above.distance_at(middles).astype(np.float32)

    def _measure(self) -> None:
        origin, marked = self.origin, self.marked
        assert origin is not None
        distance, tall = self._mapped, self._tall
        if marked.any():
            cells = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            distance = np.minimum(distance, (cells - np.float32(0.5)) * np.float32(self.resolution))
        above = None if tall is None else DistanceGrid(tall, origin, self.resolution)
        self.distance = DistanceGrid(distance, origin, self.resolution, above)
