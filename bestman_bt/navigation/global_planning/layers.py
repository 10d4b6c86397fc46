"""Layers of a costmap, each for one kind of obstacle."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import ConvexHull

from bestman_bt.messages import Cylinder, OccupancyGrid, PlacedShape, Pose2D
from bestman_bt.messages.grids import OCCUPIED, UNKNOWN
from bestman_bt.messages.pose import squared_distance_to_segment
from bestman_bt.messages.shapes import bounding_corners
from bestman_bt.navigation.global_planning.footprint import LOOKS_AROUND, UpperBody
from bestman_bt.world_model.semantic_map import MapFurniture


def distance_to_polygon(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed distance (N,), metres, of ``points`` (2, N) to a convex, counter-clockwise polygon (M, 2);
    negative inside.
    """
    squared = np.full(points.shape[1], np.inf)
    depth = np.full(points.shape[1], -np.inf)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        normal = np.array([end[1] - start[1], start[0] - end[0]]) / np.linalg.norm(end - start)
        np.maximum(depth, normal @ points - normal @ start, out=depth)
        np.minimum(squared, squared_distance_to_segment(points, start, end), out=squared)
    return np.where(depth < 0.0, depth, np.sqrt(squared))


class CostmapLayer(ABC):
    """A layer of a costmap, which takes the minimum of its layers; costs and footprint are based on that."""

    @abstractmethod
    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance (N,), metres, from ``points`` (2, N) in the map frame to the nearest obstacle, negative
        inside.

        Infinite without obstacles. The layer's own margins are already subtracted.
        """

    def reaching(self, height: float) -> CostmapLayer:
        """Return the part that reaches ``height`` metres or higher; the layer itself if heights are unknown."""
        return self


@dataclass(frozen=True, eq=False)
class ShapeLayer(CostmapLayer):
    """The outlines of ``shapes`` in the map frame, seen from above.

    Those that end below ``floor_height`` or begin above ``robot_height``, metres, are omitted.
    """

    shapes: Sequence[PlacedShape]
    floor_height: float
    robot_height: float

    def reaching(self, height: float) -> ShapeLayer:
        """Return the layer without the shapes that end below ``height`` metres."""
        return replace(self, floor_height=max(self.floor_height, height))

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of ``points`` (2, N) to the shapes, (N,) metres."""
        distance = np.full(points.shape[1], np.inf)
        for placed in self.shapes:
            outline = _outline_on_floor(placed, self.floor_height, self.robot_height)
            if outline is not None:
                np.minimum(distance, distance_to_polygon(points, outline), out=distance)
        return distance


def _outline_on_floor(placed: PlacedShape, floor: float, ceiling: float) -> NDArray[np.float64] | None:
    """Return the convex outline of a shape seen from above, (N, 2) counter-clockwise, or None if a robot never meets
    it.
    """
    points = _corners(placed)
    if points[:, 2].max() < floor or points[:, 2].min() > ceiling:
        return None
    return _hull(points[:, :2])


def _corners(placed: PlacedShape) -> NDArray[np.float64]:
    """Return the corners of a shape, or of a body around it, (N, 3)."""
    shape = placed.shape
    if isinstance(shape, Cylinder):
        turn = np.arange(16) * (2 * math.pi / 16)
        # The corners lie outside the circle, so that the sides touch it.
        ring = shape.radius / math.cos(math.pi / 16) * np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.vstack([np.column_stack([ring, np.full(16, z)]) for z in (-shape.length / 2, shape.length / 2)])
    else:
        points = bounding_corners(shape)
    corners: NDArray[np.float64] = placed.pose.apply(points)
    return corners


def _hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    hull: NDArray[np.float64] = points[ConvexHull(points).vertices]
    return hull


@dataclass(frozen=True, eq=False)
class FurnitureLayer(CostmapLayer):
    """Outlines of ``pieces`` with their handles, enlarged by possible position and heading errors.

    ``position_error``: metres, each way, and ``heading_error``: radians, unless a piece has smaller ones.
    """

    pieces: Sequence[MapFurniture]
    position_error: float
    heading_error: float

    def reaching(self, height: float) -> FurnitureLayer:
        """Return the pieces that are so high."""
        high = [piece for piece in self.pieces if piece.height >= height]
        return self if len(high) == len(self.pieces) else replace(self, pieces=high)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of ``points`` (2, N) to the furniture, (N,) metres."""
        distance = np.full(points.shape[1], np.inf)
        for piece in self.pieces:
            position_error = min(self.position_error, piece.position_error)
            for corners in (piece.corners(), *(_hull(room[:, :2]) for room in _handle_rooms(piece))):
                for outline in _turned(piece, corners, min(self.heading_error, piece.heading_error)):
                    np.minimum(distance, distance_to_polygon(points, outline) - position_error, out=distance)
        return distance


def _handle_rooms(piece: MapFurniture) -> Iterator[NDArray[np.float64]]:
    """Yield the corners (8, 3), map frame, of the boxes that contain the handles of closed doors and drawers."""
    rooms = (door.handle_room for door in piece.articulations)
    return (_corners(PlacedShape(room.shape, piece.pose.to_pose() @ room.pose)) for room in rooms if room is not None)


def _turned(piece: MapFurniture, corners: NDArray[np.float64], heading_error: float) -> Iterator[NDArray[np.float64]]:
    """Yield an outline (N, 2) of a piece in the map frame, turned about the piece within its heading error."""
    centre = piece.pose.xy
    corners = corners - centre
    for turn in (-heading_error, 0.0, heading_error) if heading_error else (0.0,):
        yield Pose2D(centre[0], centre[1], turn).apply(corners)


_ROUND = np.array([[math.cos(turn), math.sin(turn)] for turn in np.arange(16) * math.pi / 8])


@dataclass(frozen=True, eq=False)
class UnseenOutline:
    """A convex area with an obstacle that the lidar cannot see. ``corners``: (N, 2) metres, counter-clockwise.

    ``low``: whether the base itself may hit it, although it may be higher than the lidar.
    """

    corners: NDArray[np.float64]
    height: float
    low: bool = False


def unseen_outlines(
    pieces: Iterable[MapFurniture],
    shapes: Iterable[PlacedShape],
    position_error: float,
    heading_error: float,
    upper: UpperBody,
) -> tuple[UnseenOutline, ...]:
    """Return the outlines in the map frame that a robot with this upper body may hit without seeing them.

    These are ``pieces`` with their possible errors (as in ``FurnitureLayer``), unless the lidar sees their full outline
    or the robot fits under all their boards, handles, and those ``shapes`` in the map frame that lie above or below the
    lidar plane.
    """
    outlines = []
    for piece in pieces:
        off, turn = min(position_error, piece.position_error), min(heading_error, piece.heading_error)
        for room in _handle_rooms(piece):
            low, high = float(room[:, 2].min()), float(room[:, 2].max())
            if low < upper.top:
                area = _possible_area(piece, _hull(room[:, :2]), off, turn)
                outlines.append(UnseenOutline(area, high, low < upper.lidar_height + LOOKS_AROUND))
        boards = [_corners(placed)[:, 2].min() for placed in piece.shapes]
        if piece.solid_at_lidar or piece.is_passage or min(boards, default=0.0) > upper.top:
            continue
        outlines.append(UnseenOutline(_possible_area(piece, piece.corners(), off, turn), piece.height))
    for placed in shapes:
        points = _corners(placed)
        low, high = points[:, 2].min(), points[:, 2].max()
        if low < upper.top and not low <= upper.lidar_height <= high:
            outlines.append(UnseenOutline(_hull(points[:, :2]), float(high)))
    return tuple(outlines)


def _possible_area(
    piece: MapFurniture, corners: NDArray[np.float64], position_error: float, heading_error: float
) -> NDArray[np.float64]:
    """Return the area that an outline (N, 2) of a piece may cover, given the position error of the piece."""
    turned = np.concatenate(list(_turned(piece, corners, heading_error)))
    return _hull((turned[:, None] + position_error * _ROUND).reshape(-1, 2))


@dataclass(frozen=True, eq=False)
class CellLayer(CostmapLayer):
    """The ``blocked`` cells (rows, columns) of a grid; each fills its square, so distances are from its border."""

    grid: OccupancyGrid
    blocked: NDArray[np.bool_]

    @classmethod
    def occupied(cls, grid: OccupancyGrid) -> CellLayer:
        """Return the layer of the cells of at least ``OCCUPIED`` / 2."""
        return cls(grid, grid.data >= OCCUPIED / 2)

    @classmethod
    def unknown(cls, grid: OccupancyGrid) -> CellLayer:
        """Return the layer of unseen cells."""
        return cls(grid, grid.data == UNKNOWN)

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of ``points`` (2, N) to the blocked cells, (N,) metres; infinite beyond the grid."""
        blocked = self.blocked
        cells = np.where(blocked, -_to_squares(~blocked), _to_squares(blocked)) * self.grid.resolution
        column, row = np.floor((points - self.grid.origin[:, None]) / self.grid.resolution).astype(np.intp)
        rows, columns = blocked.shape
        on_grid = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        distance = np.full(points.shape[1], np.inf)
        distance[on_grid] = cells[row[on_grid], column[on_grid]]
        return distance


def _to_squares(cells: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the distance, in cells, from the centre of each cell to the nearest square of ``cells`` (rows, columns);
    exact. Without any, it is larger than the grid, and finite, because distances are interpolated.

    The point of a square that is nearest to the centre of another cell is a corner, or the middle of an edge: a node of
    the grid of half the spacing.
    """
    if not cells.any():
        return np.full(cells.shape, float(sum(cells.shape)))
    rows, columns = cells.shape
    nodes = np.zeros((2 * rows + 1, 2 * columns + 1), dtype=bool)
    for row in range(3):
        for column in range(3):
            nodes[row : row + 2 * rows : 2, column : column + 2 * columns : 2] |= cells
    distance: NDArray[np.float64] = ndimage.distance_transform_edt(~nodes)[1::2, 1::2] / 2
    return distance


@dataclass(frozen=True, eq=False)
class StaticLayer(CostmapLayer):
    """Walls of the map. ``walls``: (N, 4) segments x1, y1, x2, y2 in metres."""

    walls: NDArray[np.float64]

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance to walls, which have no inside."""
        squared = np.full(points.shape[1], np.inf)
        for segment in self.walls:
            np.minimum(squared, squared_distance_to_segment(points, segment[:2], segment[2:]), out=squared)
        distance: NDArray[np.float64] = np.sqrt(squared)
        return distance
