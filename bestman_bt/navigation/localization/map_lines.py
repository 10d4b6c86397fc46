"""The lines of a map that a lidar can hit, each with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.grids import OCCUPIED
from bestman_bt.world_model.semantic_map import SemanticMap

PlanarMap: TypeAlias = SemanticMap | OccupancyGrid
"""The map for localisation: walls and furniture with names, or an occupancy grid."""

CELL_STD = 0.3
"""Standard deviation of the position of a surface within its cell, in cells: it may be anywhere between the cell's
sides.
"""
STRAIGHT = 0.8
"""Maximum deviation of a border of occupied cells from its line, cells."""


@dataclass(frozen=True, eq=False)
class MapLines:
    """Lines of the map. ``segments``: (N, 4) x1, y1, x2, y2 in metres. ``bodies``: (N,) index of the body of each.

    ``body_std``: (M,) metres, standard deviation of a body as a whole.
    """

    segments: NDArray[np.float64]
    bodies: NDArray[np.intp]
    body_std: NDArray[np.float64]


def map_lines(planar_map: PlanarMap, wall_std: float, furniture_std: float) -> MapLines:
    """Return walls and outlines of solid furniture, or the borders of occupied cells of a grid.

    ``wall_std``, ``furniture_std``: metres, errors of a wall and of a piece of furniture; those of a grid follow from
    its cells.
    """
    if isinstance(planar_map, OccupancyGrid):
        borders = _borders(planar_map)
        std = np.full(len(borders), CELL_STD * planar_map.resolution)
        return MapLines(borders, np.arange(len(borders)), std)
    walls = planar_map.walls
    solid = [f for f in planar_map.furniture.values() if f.solid_at_lidar]
    segments = [walls]
    for furniture in solid:
        corners = furniture.corners()
        segments.append(np.hstack([corners, np.roll(corners, -1, axis=0)]))
    bodies = np.concatenate([np.arange(len(walls)), len(walls) + np.repeat(np.arange(len(solid)), 4)])
    stds = np.concatenate([np.full(len(walls), wall_std), np.full(len(solid), furniture_std)])
    return MapLines(np.concatenate(segments), bodies, stds)


def open_furniture(planar_map: PlanarMap) -> NDArray[np.float64]:
    """Return the furniture of which a lidar sees only legs or boards, (N, 5): x, y, theta and half extents along x and
    y, metres and radians.

    The extents are grown by the piece's position error, metres.
    """
    pieces = [] if isinstance(planar_map, OccupancyGrid) else planar_map.furniture.values()
    rows = [
        (*f.pose.xy, f.pose.theta, *(np.array(f.footprint) / 2 + f.position_error))
        for f in pieces
        if not f.solid_at_lidar
    ]
    return np.array(rows, dtype=float).reshape(-1, 5)


def within(rectangles: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points (N, 2) lie in any of the rectangles (M, 5) of ``open_furniture``."""
    x, y, theta, half_x, half_y = rectangles.T[:, :, None]
    dx, dy = points[:, 0] - x, points[:, 1] - y
    along, across = np.cos(theta) * dx + np.sin(theta) * dy, np.cos(theta) * dy - np.sin(theta) * dx
    inside: NDArray[np.bool_] = np.any((np.abs(along) <= half_x) & (np.abs(across) <= half_y), axis=0)
    return inside


def _borders(grid: OccupancyGrid) -> NDArray[np.float64]:
    """Return the borders of occupied regions as segments (N, 4), through the centres of their outermost cells.

    A wall of one cell becomes a line there and back, as a wall that is seen from both sides should.
    """
    occupied = (grid.data == OCCUPIED).astype(np.uint8)
    contours, _ = cv2.findContours(occupied, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    segments = [np.empty((0, 4))]
    for contour in contours:
        corners = cv2.approxPolyDP(contour, STRAIGHT, True)[:, 0, ::-1]
        points = grid.to_points(corners)
        if len(points) == 1:  # a lone cell is as wide as a cell
            half = np.array([grid.resolution / 2, 0.0])
            points = np.vstack([points - half, points + half])
        segments.append(np.hstack([points, np.roll(points, -1, axis=0)]))
    return np.concatenate(segments)
