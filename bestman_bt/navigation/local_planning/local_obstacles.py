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
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer, ObstacleLayerParameters

FAR = 10.0


@dataclass(frozen=True)
class LocalObstaclesParameters(ObstacleLayerParameters):
    """Those of its layer, for a square of 6 m."""

    size: Annotated[Positive, "m"] = 6.0


class LocalObstacles:
    """Takes in scans; ``distance``: to everything around, known or seen; ``points``: what the map lacks."""

    def __init__(self, parameters: LocalObstaclesParameters | None = None) -> None:
        self._parameters = p = parameters or LocalObstaclesParameters()
        self._layer = ObstacleLayer(p)
        self._costmap: Costmap | None = None
        cells = round(p.size / p.resolution)
        self._mapped: NDArray[np.float32] = np.full((cells, cells), FAR, dtype=np.float32)
        self._tall: NDArray[np.float32] | None = None
        self.distance = DistanceGrid(self._mapped, (0.0, 0.0), p.resolution)

    @property
    def points(self) -> NDArray[np.float64]:
        """(N, 2) What stands and the map lacks: middles of cells, map frame, metres."""
        return self._layer.points

    @property
    def moving(self) -> list[MovingObstacle]:
        """What moves, as of the last scan."""
        return self._layer.moving

    def use_costmap(self, costmap: Costmap | None) -> None:
        """What the map knows from now on."""
        self._costmap = costmap
        self._layer.use_costmap(costmap)
        if self._layer.origin is not None:
            self._rasterise_map(self._layer.origin)
            self._measure()

    def centre_on(self, pose: Pose2D) -> None:
        """Make sure that the square lies around ``pose``."""
        before = self._layer.origin
        self._layer.centre_on(pose)
        if self._layer.origin is not None and self._layer.origin != before:
            self._rasterise_map(self._layer.origin)
            self._measure()

    def update(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        """Take in a scan and where it was taken."""
        self.centre_on(map_from_lidar)
        self._layer.update(scan, map_from_lidar)
        self._measure()

    def _rasterise_map(self, origin: tuple[float, float]) -> None:
        if self._costmap is None:
            self._mapped, self._tall = np.full_like(self._mapped, FAR), None
            return
        along = (np.arange(self._mapped.shape[0]) + 0.5) * self._parameters.resolution
        x, y = np.meshgrid(origin[0] + along, origin[1] + along)
        middles, above = np.stack([x, y], axis=-1), self._costmap.above
        self._mapped = self._costmap.distance_at(middles).astype(np.float32)
        self._tall = None if above is None else above.distance_at(middles).astype(np.float32)

    def _measure(self) -> None:
        p, marked = self._parameters, self._layer.marked
        assert self._layer.origin is not None
        distance, tall = self._mapped, self._tall
        if marked.any():
            cells = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            distance = np.minimum(distance, (cells - np.float32(0.5)) * np.float32(p.resolution))
        origin = self._layer.origin
        above = None if tall is None else DistanceGrid(tall, origin, p.resolution)
        self.distance = DistanceGrid(distance, origin, p.resolution, above)
