"""Costmaps: the distance of each cell to the nearest obstacle, and the cost of driving there.

As in nav2, places nearer than the inscribed radius are lethal and the cost decays with the distance beyond it. In
contrast to nav2, each cell holds an exact signed distance (from the outlines, not from other cells) and reads are
interpolated, so that a footprint is checked to millimetres on a coarse grid. If something extends beyond the base above
it, a second field holds the distance to obstacles of that height.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import override

from bestman_bt.messages import OccupancyGrid, Pose2D
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.grids import FREE, OCCUPIED, cell_centres
from bestman_bt.messages.shapes import NonNegative, NotBelow, Positive
from bestman_bt.navigation.global_planning.footprint import Footprint, at_poses
from bestman_bt.navigation.global_planning.layers import (
    CellLayer,
    CostmapLayer,
    FurnitureLayer,
    ShapeLayer,
    StaticLayer,
    UnseenOutline,
    unseen_outlines,
)
from bestman_bt.world_model.openness import articulation_obstacles
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import Obstacle, WorldModel


@dataclass(frozen=True)
class Rasterization:
    """Parameters of the cells of a costmap.

    ``resolution``: metres per cell. ``clearance``: metres from every outline. ``furniture_position_error`` (metres,
    each way) and ``furniture_heading_error`` (radians): largest error of mapped furniture; a measured piece has its own
    (``MapFurniture.position_error``). ``cost_weight``: extra cost of a metre driven at the lethal distance,
    ``cost_decay``: metres beyond it at which it has fallen to 1/e, instead of an inflation radius. ``floor_height``:
    metres; obstacles entirely below ``floor_height`` or above ``robot_height`` are ignored. ``static``: whether to
    include walls. ``furniture``: whether to include furniture. ``doors``: whether to include doors and their frames.
    """

    resolution: Annotated[Positive, "m per cell"] = 0.05
    clearance: Annotated[NonNegative, "m"] = 0.005
    furniture_position_error: Annotated[NonNegative, "m"] = 0.03
    furniture_heading_error: Annotated[NonNegative, "rad"] = math.radians(2.0)
    cost_weight: NonNegative = 3.0
    cost_decay: Annotated[Positive, "m"] = 0.15
    floor_height: Annotated[NonNegative, "m"] = 0.02
    robot_height: Annotated[Positive, NotBelow("floor_height"), "m"] = 1.8
    static: bool = True
    furniture: bool = True
    doors: bool = True


@dataclass(frozen=True, eq=False)
class Costmap:
    """Distances to obstacles on a grid: ``distance`` (rows, columns), metres from each cell's centre to the nearest
    obstacle or the border, negative inside.

    Row 0 is at the smallest y. ``origin``: (2,) metres in the map frame, the outer corner of cell (0, 0). Margins for
    map errors are already subtracted. ``tall``: the same for obstacles that reach the footprint's overhang, or None
    without an overhang. ``unseen``: obstacles for the upper body that the lidar cannot see; the distances include them.
    """

    distance: NDArray[np.float64]
    origin: NDArray[np.float64]
    footprint: Footprint
    rasterization: Rasterization
    tall: NDArray[np.float64] | None = None
    unseen: tuple[UnseenOutline, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "distance", frozen_array(self.distance, (None, None), "Costmap distance"))
        if min(self.distance.shape) < 2:
            raise ValueError(f"Costmap distance should have 2 rows and columns or more but has {self.distance.shape}")
        if (self.tall is None) != (self.footprint.overhang is None):
            raise ValueError("Costmap tall should be given where its footprint has an overhang, and only there")
        if self.tall is not None:
            object.__setattr__(self, "tall", frozen_array(self.tall, self.distance.shape, "Costmap tall"))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "Costmap origin"))

    @classmethod
    def from_map(
        cls,
        semantic_map: SemanticMap,
        footprint: Footprint,
        obstacles: Iterable[Obstacle] = (),
        rasterization: Rasterization = Rasterization(),
    ) -> Costmap:
        """Return the costmap of walls, furniture (with margins for map errors), door frames and ``obstacles``."""
        p = rasterization
        x_min, y_min, x_max, y_max = semantic_map.bounds(margin=2 * p.resolution)
        shape = math.ceil((y_max - y_min) / p.resolution), math.ceil((x_max - x_min) / p.resolution)
        pieces = semantic_map.furniture.values()
        furniture = [piece for piece in pieces if not piece.is_passage]
        frames = [shape for piece in pieces if piece.is_passage for shape in piece.shapes_in_map()]
        seen = [shape for obstacle in obstacles for shape in obstacle.shapes]
        layers: list[CostmapLayer] = []
        if p.static:
            layers.append(StaticLayer(semantic_map.walls))
        if p.furniture:
            layers.append(FurnitureLayer(furniture, p.furniture_position_error, p.furniture_heading_error))
        if p.doors:
            layers.append(ShapeLayer(frames, p.floor_height, p.robot_height))
        layers.append(ShapeLayer(seen, p.floor_height, p.robot_height))
        costmap = cls.of_layers(layers, shape, np.array([x_min, y_min], dtype=float), footprint, p)
        if footprint.upper is None:
            return costmap
        return replace(
            costmap,
            unseen=unseen_outlines(
                furniture, seen, p.furniture_position_error, p.furniture_heading_error, footprint.upper
            ),
        )

    @classmethod
    def of_layers(
        cls,
        layers: Sequence[CostmapLayer],
        shape: tuple[int, int],
        origin: NDArray[np.float64],
        footprint: Footprint,
        rasterization: Rasterization = Rasterization(),
    ) -> Costmap:
        """Return the minimum of all ``layers``, at ``shape`` (rows, columns) cells from ``origin`` (2,), metres."""
        p = rasterization
        x, y = (origin[axis] + (np.arange(shape[1 - axis]) + 0.5) * p.resolution for axis in (0, 1))
        centres = np.stack(np.meshgrid(x, y)).reshape(2, -1)
        # No base may stand out over the border.
        inward = np.minimum(centres.T - origin, origin + np.array(shape[::-1]) * p.resolution - centres.T)
        distance: NDArray[np.float64] = inward.min(axis=1)
        overhang = footprint.overhang
        tall = None if overhang is None else distance.copy()
        for layer in layers:
            away = layer.distance(centres)
            np.minimum(distance, away, out=distance)
            if tall is not None and overhang is not None:
                high = layer.reaching(overhang.height)
                np.minimum(tall, away if high is layer else high.distance(centres), out=tall)
        above = None if tall is None else (tall - p.clearance).reshape(shape)
        return cls((distance - p.clearance).reshape(shape), origin, footprint, p, above)

    @classmethod
    def from_grid(
        cls,
        grid: OccupancyGrid,
        footprint: Footprint,
        unknown_is_obstacle: bool = True,
        rasterization: Rasterization = Rasterization(),
    ) -> Costmap:
        """Return a costmap of an occupancy grid, for example from SLAM or a file, with its resolution.

        A cell is an obstacle at values of at least ``OCCUPIED`` / 2; unknown ones if ``unknown_is_obstacle``. An
        obstacle fills its cell, so distances are from the cell's border.
        """
        p = replace(rasterization, resolution=grid.resolution)
        layers = [CellLayer.occupied(grid)]
        if unknown_is_obstacle:
            layers.append(CellLayer.unknown(grid))
        rows, columns = grid.data.shape
        return cls.of_layers(layers, (rows, columns), grid.origin, footprint, p)

    @property
    def resolution(self) -> float:
        """Metres per cell."""
        return self.rasterization.resolution

    @property
    def grid(self) -> OccupancyGrid:
        """Return the cells whose centre is in, or within half a cell of, an obstacle, as an occupancy grid."""
        data = np.where(self.distance <= self.resolution / 2, OCCUPIED, FREE).astype(np.int8)
        return OccupancyGrid(data, self.resolution, self.origin)

    def grid_points(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Return the map points (..., 2), metres, at the centres of ``cells`` (row, column) (..., 2)."""
        return cell_centres(cells, self.resolution, self.origin)

    def cells(self, points: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return rows and columns of the cells at map points (..., 2), metres; points outside get the nearest border
        cell.
        """
        cells = np.floor((np.asarray(points, dtype=float) - self.origin) / self.resolution).astype(np.intp)
        rows, columns = self.distance.shape
        return np.clip(cells[..., 1], 0, rows - 1), np.clip(cells[..., 0], 0, columns - 1)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return which map points (..., 2), metres, lie on the costmap, (...) bool."""
        cells = (np.asarray(points, dtype=float) - self.origin) / self.resolution
        rows, columns = self.distance.shape
        inside: NDArray[np.bool_] = np.all((cells >= 0) & (cells < (columns, rows)), axis=-1)
        return inside

    def distance_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the interpolated distance to the nearest obstacle at map points (..., 2), metres; -1 outside the
        costmap.
        """
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

    @cached_property
    def above(self) -> Costmap | None:
        """The costmap of tall obstacles for the outline with the overhang, or None without an overhang."""
        if self.tall is None:
            return None
        return replace(self, distance=self.tall, tall=None, footprint=self.footprint.above)

    @cached_property
    def for_turning(self) -> Costmap:
        """The costmap for turning in place: of a disc of the circumscribed radius, overhang included.

        Without an overhang it is this costmap, as for ``for_passing``.
        """
        return self._of_disc(self.footprint.above.circumscribed_radius - self.footprint.circumscribed_radius)

    @cached_property
    def for_passing(self) -> Costmap:
        """The costmap of a disc of the inscribed radius."""
        return self._of_disc(self.footprint.above.inscribed_radius - self.footprint.inscribed_radius)

    @cached_property
    def without_overhang(self) -> Costmap:
        """The costmap for the base without its overhang."""
        if self.tall is None:
            return self
        return replace(self, tall=None, footprint=replace(self.footprint, overhang=None))

    def _of_disc(self, more: float) -> Costmap:
        """Return the layer of the bare base, with tall obstacles ``more`` metres nearer."""
        if self.tall is None:
            return self
        return replace(self.without_overhang, distance=np.minimum(self.distance, self.tall - more))

    def cost(self, distance: ArrayLike, lethal_distance: float, slack: float = 0.0) -> NDArray[np.float64]:
        """Return the cost per metre (≥ 1) at ``distance`` metres from an obstacle; infinite below ``lethal_distance``.

        ``slack``: metres below ``lethal_distance`` within which the cost is finite, at its maximum.
        """
        beyond = np.asarray(distance, dtype=float) - lethal_distance
        p = self.rasterization
        cost = 1.0 + p.cost_weight * np.exp(-np.maximum(beyond, 0.0) / p.cost_decay)
        limited: NDArray[np.float64] = np.where(beyond < -slack, np.inf, cost)
        return limited

    def footprint_clearance(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the clearance (N,), metres, between the footprint and the nearest obstacle, for ``poses`` (N, 3) of x,
        y, theta.

        Zero or negative if it touches one or leaves the costmap. The overhang is checked against obstacles of its
        height.
        """
        points = at_poses(self.footprint.outline(self.resolution / 2), poses)
        around = self.distance_at(points).min(axis=1)
        inside = self.distance_at(poses[:, :2]) - self.footprint.inscribed_radius
        clearance: NDArray[np.float64] = np.minimum(around, inside)
        return clearance if self.tall is None else np.minimum(clearance, self.overhang_clearance(poses))

    def overhang_clearance(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a lower bound of the clearance, metres, between the overhang and the nearest tall obstacle; infinite
        without one.

        The outline is covered by discs without interpolation, which would hide thin walls between cells. Up to 2 cm of
        clearance may be missed.
        """
        if self.tall is None:
            return np.full(len(poses), np.inf)
        discs = self.footprint.discs_above
        clearance: NDArray[np.float64] = (self._at_least(at_poses(discs[:, :2], poses)) - discs[:, 2]).min(
            axis=1, initial=np.inf
        )
        return clearance

    def _at_least(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a lower bound of the distance to tall obstacles at points (..., 2): that of each cell around, less the
        way.
        """
        assert self.tall is not None
        rows, columns = self.tall.shape
        x, y = np.moveaxis((points - self.origin) / self.resolution - 0.5, -1, 0)
        inside = (x >= -0.5) & (x < columns - 0.5) & (y >= -0.5) & (y < rows - 0.5)
        column = np.clip(x.astype(np.intp), 0, columns - 2)
        row = np.clip(y.astype(np.intp), 0, rows - 2)
        flat, corner = self.tall.ravel(), row * columns + column
        bound = np.full(x.shape, -np.inf)
        for down in (0, 1):
            for right in (0, 1):
                way = self.resolution * np.hypot(x - column - right, y - row - down)
                np.maximum(bound, flat[corner + down * columns + right] - way, out=bound)
        distance: NDArray[np.float64] = np.where(inside, bound, -1.0)
        return distance

    def clearance_at(self, pose: Pose2D) -> float:
        """Return the clearance between the footprint at ``pose`` and the nearest obstacle, metres, as
        ``footprint_clearance``.
        """
        return float(self.footprint_clearance(np.array([[pose.x, pose.y, pose.theta]]))[0])


class CostmapBuilder(ABC):
    """Creates costmaps; ``obstacle``: whether those for planning include obstacles that the lidar sees and the map
    lacks."""

    obstacle: bool = True

    @abstractmethod
    def of_world(self, world: WorldModel, footprint: Footprint) -> Costmap:
        """Return the costmap of the map with the believed positions of doors and drawers."""

    @abstractmethod
    def of_grid(self, grid: OccupancyGrid, footprint: Footprint) -> Costmap:
        """Return the costmap of an occupancy grid."""


@dataclass(frozen=True)
class LayeredCostmap(Rasterization, CostmapBuilder):
    """Creates costmaps of the map with the believed door positions, or of an occupancy grid.

    ``obstacle``: whether planning costmaps include obstacles that the lidar sees and the map lacks. ``unknown``:
    whether unseen cells are obstacles.
    """

    obstacle: bool = True
    unknown: bool = True

    @override
    def of_world(self, world: WorldModel, footprint: Footprint) -> Costmap:
        """Return the costmap of walls, furniture, room doors, and open doors and drawers."""
        doors = articulation_obstacles(world) if self.doors else ()
        return Costmap.from_map(world.map, footprint, doors, self)

    @override
    def of_grid(self, grid: OccupancyGrid, footprint: Footprint) -> Costmap:
        """Return the costmap of the occupied cells of ``grid`` and, if ``unknown`` is set, of its unknown cells."""
        return Costmap.from_grid(grid, footprint, self.unknown, self)
