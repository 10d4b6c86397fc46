"""Scans as a lidar would take them among segments."""

from __future__ import annotations

import math

import numpy as np

from bestman_bt.messages import LaserScan, OccupancyGrid, Pose2D
from bestman_bt.navigation.localization.correlative_search import DistanceField
from bestman_bt.navigation.localization.scan_to_map import cast_rays
from bestman_bt.world_model.semantic_map import SemanticMap

BASE_FROM_LIDAR = Pose2D(0.1, 0.0, 0.05)
BEAMS = 360


def scan_at(pose: Pose2D, segments: np.ndarray, rng: np.random.Generator, noise: float = 0.01) -> LaserScan:
    angles = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)
    ranges, _ = cast_rays(segments, pose @ BASE_FROM_LIDAR, angles)
    ranges = np.maximum(0.0, ranges + rng.normal(0.0, noise, BEAMS))
    return LaserScan(np.where(ranges < 8.0, ranges, np.inf), -math.pi, 2 * math.pi / BEAMS, 0.1, 8.0, 0.0)


def ahead_only(scan: LaserScan, half: float) -> LaserScan:
    """What a lidar sees that looks ahead by ``half`` radians to each side."""
    ahead = np.abs(scan.angles) < half
    angle_min = float(scan.angles[ahead][0])
    return LaserScan(scan.ranges[ahead], angle_min, scan.angle_increment, scan.range_min, scan.range_max, scan.stamp)


def grid_of(semantic_map: SemanticMap, resolution: float = 0.05) -> OccupancyGrid:
    """The map as a mapping robot would have drawn it: walls are occupied, the rest of the building is free."""
    field = DistanceField.of_map(semantic_map, resolution, reach=0.5, clearance=0.0)
    data = np.where(field.floor, 0, -1)
    data[field.distance < 0.51 * resolution] = 100  # walls lie on the borders of cells here
    return OccupancyGrid(data.astype(np.int8), resolution, field.origin)
