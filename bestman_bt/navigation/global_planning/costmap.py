"""Costmaps: how far every place on the floor is from the next obstacle, and what it costs to drive there.

As in nav2, places nearer than the inscribed radius are lethal and the cost decays with the distance beyond it. Unlike
there, each cell holds an exact signed distance (from the outlines, not from other cells) and reads are interpolated,
so that a footprint is checked to millimetres on a coarse grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.spatial import ConvexHull

from bestman_bt.messages import Box, Cylinder, Mesh, OccupancyGrid, PlacedShape, Pose2D, Sphere
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.world_model import MapFurniture, Obstacle, SemanticMap


@dataclass(frozen=True)
class CostmapParameters:
    """How the map is rasterised.

    ``resolution``: metres per cell. ``clearance``: metres kept from every outline. ``furniture_position_error``
    (metres, each way) and ``furniture_heading_error`` (radians): how far furniture may be from where the map has it; a
    piece that is known better (``MapFurniture.position_error``) is as far off as that.
    ``cost_weight``: extra cost of a metre driven at the lethal distance, ``cost_decay``: metres beyond it at which
    that has fallen to 1/e. ``floor_height``: metres; obstacles that end below or begin above ``robot_height`` are left
    out.
    """

    resolution: float = 0.05
    clearance: float = 0.005
    furniture_position_error: float = 0.03
    furniture_heading_error: float = math.radians(2.0)
    cost_weight: float = 3.0
    cost_decay: float = 0.15
    floor_height: float = 0.02
    robot_height: float = 1.8


@dataclass(frozen=True, eq=False)
class Costmap:
    """``distance``: (rows, columns) metres from each cell's centre to the next obstacle, negative inside one.

    Row 0 is at the smallest y. ``origin``: (2,) metres in the map frame, the outer corner of cell (0, 0).
    Margins for what the map does not know exactly are already taken off.
    """

    distance: NDArray[np.float64]
    origin: NDArray[np.float64]
    footprint: Footprint
    parameters: CostmapParameters

    def __post_init__(self) -> None:
        object.__setattr__(self, "distance", frozen_array(self.distance, (None, None), "Costmap distance"))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "Costmap origin"))

    @classmethod
    def from_map(
        cls,
        semantic_map: SemanticMap,
        footprint: Footprint,
        obstacles: Iterable[Obstacle] = (),
        parameters: CostmapParameters | None = None,
    ) -> Costmap:
        """Rasterise walls, furniture (with margins for its errors) and ``obstacles`` that were seen."""
        parameters = parameters or CostmapParameters()
        x_min, y_min, x_max, y_max = semantic_map.bounds(margin=2 * parameters.resolution)
        columns = math.ceil((x_max - x_min) / parameters.resolution)
        rows = math.ceil((y_max - y_min) / parameters.resolution)
        origin = np.array([x_min, y_min], dtype=float)
        x = origin[0] + (np.arange(columns) + 0.5) * parameters.resolution
        y = origin[1] + (np.arange(rows) + 0.5) * parameters.resolution
        centres = np.stack(np.meshgrid(x, y)).reshape(2, -1)
        squared = np.full(rows * columns, np.inf)
        for segment in semantic_map.walls:
            np.minimum(squared, _squared_distance_to_segment(centres, segment[:2], segment[2:]), out=squared)
        distance = np.sqrt(squared)
        for furniture in semantic_map.furniture.values():
            heading_error = min(parameters.furniture_heading_error, furniture.heading_error)
            position_error = min(parameters.furniture_position_error, furniture.position_error)
            for outline in _possible_outlines(furniture, heading_error):
                outside = _distance_to_polygon(centres, outline) - position_error
                np.minimum(distance, outside, out=distance)
        for obstacle in obstacles:
            for placed in obstacle.shapes:
                outline_on_floor = _outline_on_floor(placed, parameters.floor_height, parameters.robot_height)
                if outline_on_floor is not None:
                    np.minimum(distance, _distance_to_polygon(centres, outline_on_floor), out=distance)
        return cls((distance - parameters.clearance).reshape(rows, columns), origin, footprint, parameters)

    @classmethod
    def from_grid(
        cls,
        grid: OccupancyGrid,
        footprint: Footprint,
        unknown_is_obstacle: bool = True,
        parameters: CostmapParameters | None = None,
    ) -> Costmap:
        """From a map of cells, for example of SLAM or of a file; the costmap takes over its resolution.

        A cell is an obstacle from ``OCCUPIED`` / 2 on; unknown ones where ``unknown_is_obstacle``. An obstacle fills
        its cell, so distances are from the cell's border.
        """
        parameters = replace(parameters or CostmapParameters(), resolution=grid.resolution)
        blocked = grid.data >= OCCUPIED / 2
        if unknown_is_obstacle:
            blocked |= grid.data == UNKNOWN
        outside = ndimage.distance_transform_edt(~blocked) if blocked.any() else np.full(blocked.shape, np.inf)
        inside = ndimage.distance_transform_edt(blocked) if not blocked.all() else np.full(blocked.shape, np.inf)
        cells = np.where(blocked, 0.5 - inside, outside - 0.5)
        distance = cells * grid.resolution - parameters.clearance
        return cls(np.clip(distance, -1e3, 1e3), grid.origin, footprint, parameters)

    @property
    def resolution(self) -> float:
        """Metres per cell."""
        return self.parameters.resolution

    @property
    def grid(self) -> OccupancyGrid:
        """The cells whose centre lies in an obstacle (or within half a cell of one) as an occupancy grid."""
        data = np.where(self.distance <= self.resolution / 2, OCCUPIED, FREE).astype(np.int8)
        return OccupancyGrid(data, self.resolution, self.origin)

    def grid_points(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Map points (..., 2), metres, at the centres of cells (row, column)."""
        centres: NDArray[np.float64] = (np.asarray(cells, dtype=float)[..., ::-1] + 0.5) * self.resolution
        return centres + self.origin

    def cells(self, points: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of map points (..., 2); of points beyond the costmap, those of its border."""
        cells = np.floor((np.asarray(points, dtype=float) - self.origin) / self.resolution).astype(np.intp)
        rows, columns = self.distance.shape
        return np.clip(cells[..., 1], 0, rows - 1), np.clip(cells[..., 0], 0, columns - 1)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which map points (..., 2) lie on the costmap."""
        cells = (np.asarray(points, dtype=float) - self.origin) / self.resolution
        rows, columns = self.distance.shape
        inside: NDArray[np.bool_] = np.all((cells >= 0) & (cells < (columns, rows)), axis=-1)
        return inside

    def distance_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Interpolated distance to the next obstacle at map points (..., 2), metres; -1 beyond the costmap."""
        points = np.asarray(points, dtype=float)
        rows, columns = self.distance.shape
        x = (points[..., 0] - self.origin[0]) / self.resolution - 0.5
        y = (points[..., 1] - self.origin[1]) / self.resolution - 0.5
        inside = (x >= -0.5) & (x < columns - 0.5) & (y >= -0.5) & (y < rows - 0.5)
        column = np.minimum(np.maximum(x, 0.0).astype(np.intp), columns - 2)
        row = np.minimum(np.maximum(y, 0.0).astype(np.intp), rows - 2)
        u, v = np.minimum(np.maximum(x - column, 0.0), 1.0), np.minimum(np.maximum(y - row, 0.0), 1.0)
        flat = self.distance.ravel()
        corner = row * columns + column
        value = (1 - v) * ((1 - u) * flat[corner] + u * flat[corner + 1]) + v * (
            (1 - u) * flat[corner + columns] + u * flat[corner + columns + 1]
        )
        distance: NDArray[np.float64] = np.where(inside, value, -1.0)
        return distance

    def cost(self, distance: ArrayLike, lethal_distance: float, slack: float = 0.0) -> NDArray[np.float64]:
        """Cost per metre, 1 and up, at ``distance`` metres from an obstacle; infinite below ``lethal_distance``.

        ``slack``: metres below it at which the cost is still the highest one instead.
        """
        beyond = np.asarray(distance, dtype=float) - lethal_distance
        cost = 1.0 + self.parameters.cost_weight * np.exp(-np.maximum(beyond, 0.0) / self.parameters.cost_decay)
        limited: NDArray[np.float64] = np.where(beyond < -slack, np.inf, cost)
        return limited

    def footprint_clearance(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres between the footprint and the next obstacle, (N,), for ``poses`` (N, 3) of x, y, theta.

        Zero or negative where it touches one or leaves the costmap.
        """
        outline = self.footprint.outline(self.resolution / 2)
        cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
        points = np.stack(
            [
                poses[:, 0, None] + cos * outline[:, 0] - sin * outline[:, 1],
                poses[:, 1, None] + sin * outline[:, 0] + cos * outline[:, 1],
            ],
            axis=-1,
        )
        around = self.distance_at(points).min(axis=1)
        inside = self.distance_at(poses[:, :2]) - self.footprint.inscribed_radius
        clearance: NDArray[np.float64] = np.minimum(around, inside)
        return clearance

    def clearance_at(self, pose: Pose2D) -> float:
        """Metres between the footprint at ``pose`` and the next obstacle, as ``footprint_clearance``."""
        return float(self.footprint_clearance(np.array([[pose.x, pose.y, pose.theta]]))[0])


def _squared_distance_to_segment(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """For ``points`` (2, N), a row each for x and y: faster than (N, 2)."""
    (dx, dy), (along_x, along_y) = points - start[:, None], end - start
    share = np.clip((dx * along_x + dy * along_y) / max(float(along_x**2 + along_y**2), 1e-12), 0.0, 1.0)
    squared: NDArray[np.float64] = (dx - share * along_x) ** 2 + (dy - share * along_y) ** 2
    return squared


def _distance_to_polygon(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distance of ``points`` (2, N) to a convex, counter-clockwise polygon (M, 2); negative inside."""
    squared = np.full(points.shape[1], np.inf)
    depth = np.full(points.shape[1], -np.inf)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([end[1] - start[1], start[0] - end[0]]) / np.linalg.norm(end - start)
        np.maximum(depth, normal @ points - normal @ start, out=depth)
        np.minimum(squared, _squared_distance_to_segment(points, start, end), out=squared)
    return np.where(depth < 0.0, depth, np.sqrt(squared))


def _possible_outlines(furniture: MapFurniture, heading_error: float) -> list[NDArray[np.float64]]:
    centre = furniture.pose.xy
    corners = furniture.corners() - centre
    turns = (-heading_error, 0.0, heading_error) if heading_error else (0.0,)
    return [Pose2D(centre[0], centre[1], turn).apply(corners) for turn in turns]


def _outline_on_floor(placed: PlacedShape, floor: float, ceiling: float) -> NDArray[np.float64] | None:
    """The convex outline of a shape seen from above, (N, 2) counter-clockwise; None if a robot never meets it."""
    shape = placed.shape
    if isinstance(shape, Box):
        half = np.array(shape.size) / 2
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    elif isinstance(shape, Cylinder):
        turn = np.arange(16) * (2 * math.pi / 16)
        # The corners lie outside the circle, so that the sides touch it.
        ring = shape.radius / math.cos(math.pi / 16) * np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.vstack([np.column_stack([ring, np.full(16, z)]) for z in (-shape.length / 2, shape.length / 2)])
    elif isinstance(shape, Sphere):
        points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * shape.radius
    elif isinstance(shape, Mesh):
        points = shape.vertices
    points = placed.pose.apply(points)
    if points[:, 2].max() < floor or points[:, 2].min() > ceiling:
        return None
    hull: NDArray[np.float64] = points[ConvexHull(points[:, :2]).vertices, :2]
    return hull
