"""The distance of each place to the nearest lidar surface, for scan matching, and the places where a base can be."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.grids import FREE
from bestman_bt.navigation.localization.map_lines import PlanarMap, map_lines


@dataclass(frozen=True, eq=False)
class DistanceField:
    """A distance field of the map. ``distance``: (rows, columns) float32, metres from a cell's centre to the nearest
    line, at most ``reach``.

    Row 0 is at the smallest y. ``origin``: (2,) metres in the map frame, the outer corner of cell (0, 0). ``floor``:
    (rows, columns), True if the centre of a base can be there: free, and inside the building if it is closed.
    """

    distance: NDArray[np.float32]
    floor: NDArray[np.bool_]
    origin: NDArray[np.float64]
    resolution: float
    reach: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "distance", frozen_array(self.distance, (None, None), "distance", np.float32))
        object.__setattr__(self, "floor", frozen_array(self.floor, (None, None), "floor", np.bool_))
        object.__setattr__(self, "origin", frozen_array(self.origin, (2,), "DistanceField origin"))

    @classmethod
    def of_map(
        cls, planar_map: PlanarMap, resolution: float = 0.05, reach: float = 1.0, clearance: float = 0.2
    ) -> DistanceField:
        """Rasterise a map; ``clearance``: least distance of the base's centre from obstacles, metres."""
        segments = map_lines(planar_map, 0.0, 0.0).segments
        lower = segments.reshape(-1, 2).min(axis=0) - reach
        columns, rows = np.ceil((segments.reshape(-1, 2).max(axis=0) + reach - lower) / resolution).astype(int)
        x = lower[0] + (np.arange(columns) + 0.5) * resolution
        y = lower[1] + (np.arange(rows) + 0.5) * resolution
        centres = np.stack(np.meshgrid(x, y), axis=-1)
        away, _ = cKDTree(_along(segments, resolution / 4)).query(centres, distance_upper_bound=reach)
        distance = np.minimum(away, reach)
        floor = (distance > clearance) & _indoors(distance, resolution)
        if isinstance(planar_map, OccupancyGrid):
            floor &= _free(planar_map, centres)
        else:
            for furniture in planar_map.furniture.values():
                local = np.abs(furniture.pose.inverse().apply(centres))
                floor &= (local > np.array(furniture.footprint) / 2).any(axis=-1)
        return cls(distance.astype(np.float32), floor, lower, resolution, reach)

    def index(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return indices into the flattened field of the cells of the points (x, y), arrays of one shape.

        The field extends ``reach`` beyond all lines, so that its border is valid for points outside.
        """
        rows, columns = self.distance.shape
        column = ((x - self.origin[0]) * (1.0 / self.resolution)).astype(np.int32)
        row = ((y - self.origin[1]) * (1.0 / self.resolution)).astype(np.int32)
        np.clip(column, 0, columns - 1, out=column)
        np.clip(row, 0, rows - 1, out=row)
        index: NDArray[np.int32] = row * columns + column
        return index

    def floor_points(self) -> NDArray[np.float64]:
        """Return the centres of the cells of the floor, (N, 2) metres in the map frame."""
        points: NDArray[np.float64] = self.origin + (np.argwhere(self.floor)[:, ::-1] + 0.5) * self.resolution
        return points

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return poses (count, 3) of x, y, theta, uniform over the floor and all headings."""
        points = self.floor_points()
        chosen = points[rng.integers(len(points), size=count)]
        within = rng.uniform(-0.5, 0.5, (count, 2)) * self.resolution
        return np.column_stack([chosen + within, rng.uniform(-math.pi, math.pi, count)])


def _along(segments: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Points (N, 2) on the segments, at most ``step`` metres apart."""
    starts, ends = segments[:, :2], segments[:, 2:]
    counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / step).astype(int) + 1
    of = np.repeat(np.arange(len(segments)), counts)
    number = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (number / np.maximum(counts[of] - 1, 1))[:, None]
    points: NDArray[np.float64] = starts[of] + share * (ends - starts)[of]
    return points


def _indoors(distance: NDArray[np.float64], resolution: float) -> NDArray[np.bool_]:
    """Cells that no way leads out of the map from; all, where the walls do not close anything in."""
    regions, _ = ndimage.label(distance > resolution)
    border = np.unique(np.concatenate([regions[0], regions[-1], regions[:, 0], regions[:, -1]]))
    inside = ~np.isin(regions, border)
    return inside if (inside & (distance > resolution)).any() else np.ones_like(inside)


def _free(grid: OccupancyGrid, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    cells = grid.to_cells(points)
    inside = grid.contains(cells)
    rows, columns = np.where(inside[..., None], cells, 0).transpose(2, 0, 1)
    free: NDArray[np.bool_] = inside & (grid.data[rows, columns] == FREE)
    return free
