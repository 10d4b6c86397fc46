"""Global localisation by matching a scan everywhere on the map.

E. Olson, "Real-time correlative scan matching", 2009: a coarse pass over all cells of the floor and all headings, in a
field blurred accordingly. The best places are then matched finely, as in ``ScanToMap``, and scored by a beam model,
which penalises beams through walls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from bestman_bt.messages import LaserScan, OccupancyGrid, Pose2D, wrap_angle
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.messages.grids import FREE
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, Positive
from bestman_bt.navigation.localization.base import GlobalLocalizer, LocalizationEstimate, OdometryScan, Place
from bestman_bt.navigation.localization.map_lines import PlanarMap, map_lines
from bestman_bt.navigation.localization.scan_to_map import ScanToMap, cast_rays

# How well a scan agrees with the map at a pose: the beam model of Thrun, Burgard, Fox, Probabilistic Robotics, 6.3.
# Unlike a likelihood field it knows that nothing is seen through a wall.


@dataclass(frozen=True)
class Agreement:
    """The agreement of a scan with the map. ``log_likelihood``: mean over the beams. ``explained``: fraction of the
    hits at their expected places.
    """

    log_likelihood: float
    explained: float


@dataclass(frozen=True)
class BeamModel:
    """A beam model. ``beams``: number of evenly spaced beams. ``hit_std``: metres, of lidar, map and pose together.

    ``hit``, ``short``, ``random``: fractions of beams that hit mapped surfaces, unknown obstacles in front of them
    (more probable when near, with the decay ``short_decay``, metres), or anything. ``lost``: likelihood of a beam
    without a hit if the map has a surface. ``explained_within``: metres.
    """

    beams: Count = 120
    hit_std: Annotated[Positive, "m"] = 0.06
    hit: Fraction = 0.7
    short: Fraction = 0.2
    random: Fraction = 0.1
    short_decay: Annotated[Positive, "m"] = 2.0
    lost: Fraction = 0.1
    explained_within: Annotated[Positive, "m"] = 0.12

    def agreement(self, segments: NDArray[np.float64], map_from_lidar: Pose2D, scan: LaserScan) -> Agreement:
        """Return the agreement of ``scan`` with the scan expected from ``segments`` (N, 4), metres, at
        ``map_from_lidar``.
        """
        step = max(1, len(scan.ranges) // self.beams)
        measured = scan.ranges[::step]
        expected, _ = cast_rays(segments, map_from_lidar, scan.angles[::step])
        expected = np.where(expected > scan.range_max, np.inf, expected)
        visible = expected > scan.range_min  # what is nearer cannot be measured
        hit, seen = np.isfinite(measured), np.isfinite(expected)
        with np.errstate(invalid="ignore"):
            error = measured - expected
            near = self.hit * np.exp(-0.5 * (error / self.hit_std) ** 2) / (self.hit_std * np.sqrt(2.0 * np.pi))
            before = np.where(error < 0.0, self.short * np.exp(-measured / self.short_decay) / self.short_decay, 0.0)
        by_chance = self.random / scan.range_max
        likelihood = np.where(hit & seen, near + before, 0.0) + by_chance
        likelihood[hit & ~seen] = (
            by_chance + self.short * np.exp(-measured[hit & ~seen] / self.short_decay) / self.short_decay
        )
        likelihood[~hit & seen] = self.lost
        likelihood[~hit & ~seen] = 1.0
        informative = visible & (hit | seen)
        if not informative.any():
            return Agreement(float(np.log(by_chance)), 0.0)
        fits = hit & seen & (np.abs(np.where(hit & seen, error, np.inf)) < self.explained_within)
        return Agreement(float(np.log(likelihood[informative]).mean()), float(fits.sum() / max(hit.sum(), 1)))


@dataclass(frozen=True)
class CorrelativeSearch(GlobalLocalizer):
    """Exhaustive search; deterministic.

    Lengths in metres, angles in radians.

    ``resolution`` and ``heading_step`` of the coarse pass, with ``points`` of the scan and a field blurred by ``blur``.
    ``candidates``: number of places that are matched finely, at least ``apart`` and ``turned_apart`` from each other;
    ``matches``: number of matches of each. Two places are the same if they end within ``same`` and ``same_heading``.
    ``independent_beams``: number of independent measurements in a scan. ``min_explained``: minimum fraction of
    explained hits. ``clearance``: of the base's centre from everything.
    """

    resolution: Annotated[Positive, "m per cell"] = 0.1
    heading_step: Annotated[Positive, "rad"] = math.radians(4.0)
    points: Count = 72
    blur: Annotated[Positive, "m"] = 0.15
    candidates: Count = 40
    apart: Annotated[NonNegative, "m"] = 0.3
    turned_apart: Annotated[NonNegative, "rad"] = math.radians(15.0)
    matches: Count = 3
    same: Annotated[NonNegative, "m"] = 0.2
    same_heading: Annotated[NonNegative, "rad"] = math.radians(6.0)
    independent_beams: Positive = 15.0
    min_explained: Fraction = 0.5
    clearance: Annotated[NonNegative, "m"] = 0.2
    beam_model: BeamModel = field(default_factory=BeamModel)

    def locate(
        self, planar_map: PlanarMap, scans: Sequence[OdometryScan], base_from_lidar: Pose2D
    ) -> tuple[Place, ...]:
        """Return the possible places, the most probable first; raises ValueError without a scan. See
        ``GlobalLocalizer.locate``.
        """
        if not scans:
            raise ValueError("locate needs at least one scan")
        if not len(map_lines(planar_map, 0.0, 0.0).segments):
            return ()
        search = _Search(planar_map, self, base_from_lidar)
        latest = scans[-1]
        found: list[tuple[float, float, LocalizationEstimate]] = []
        for rough in search.coarse(latest.scan):
            estimate = search.matched(rough, 0.5 * self.apart, self.heading_step, latest.scan)
            if any(self._is_same(estimate.pose, other.pose) for _, _, other in found):
                continue
            fits = [search.agreement(estimate.pose, latest.scan)]
            fits += [
                search.fit(estimate.pose @ latest.odometry.inverse() @ taken.odometry, taken.scan)
                for taken in scans[:-1]
            ]
            # The mean: scans from nearly one place tell the same again.
            score, explained = np.mean([(fit.log_likelihood, fit.explained) for fit in fits], axis=0).tolist()
            found.append((score, explained, estimate))
        return tuple(self._places(found))

    def _places(self, found: list[tuple[float, float, LocalizationEstimate]]) -> Iterator[Place]:
        if not found:
            return
        found.sort(key=lambda place: -place[0])
        weights = np.exp(self.independent_beams * np.array([score - found[0][0] for score, _, _ in found]))
        for probability, (_, explained, estimate) in zip((weights / weights.sum()).tolist(), found, strict=True):
            if explained >= self.min_explained:
                yield Place(estimate.pose, probability, estimate.position_std, estimate.heading_std, explained)

    def _is_same(self, pose: Pose2D, other: Pose2D) -> bool:
        turned = abs(wrap_angle(pose.theta - other.theta))
        return pose.distance_to(other) < self.same and turned < self.same_heading


class _Search:
    """One search on one map; scans are taken from ``base_from_lidar``."""

    def __init__(self, planar_map: PlanarMap, search: CorrelativeSearch, base_from_lidar: Pose2D) -> None:
        self._search = p = search
        self._base_from_lidar = base_from_lidar
        self._segments = map_lines(planar_map, 0.0, 0.0).segments
        self._field = DistanceField.of_map(planar_map, p.resolution, reach=3.0 * p.blur, clearance=p.clearance)
        # The places are off by half a cell and half a step, and furniture by centimetres: much may not fit yet.
        self._matcher = ScanToMap(planar_map, min_inlier_ratio=0.2)

    def coarse(self, scan: LaserScan) -> Iterator[Pose2D]:
        """Yield the most likely poses on the whole floor, best first; none if the scan has too few hits."""
        p, field_ = self._search, self._field
        points = self._base_from_lidar.apply(scan.points())
        if len(points) < 10:
            return
        points = points[np.linspace(0, len(points) - 1, min(p.points, len(points))).astype(int)]
        reach = math.ceil(float(np.linalg.norm(points, axis=1).max()) / p.resolution) + 1
        score_of_cell = np.exp(-0.5 * (field_.distance / p.blur) ** 2)
        padded = np.pad(score_of_cell, reach)
        columns = padded.shape[1]
        cells = np.argwhere(field_.floor)
        base = ((cells[:, 0] + reach) * columns + cells[:, 1] + reach).astype(np.int32)
        headings = np.arange(-math.pi, math.pi, p.heading_step)
        scores = np.empty((len(headings), len(cells)), dtype=np.float32)
        flat = padded.ravel()
        for number, heading in enumerate(headings):
            offsets = np.rint(Pose2D(0.0, 0.0, heading).apply(points) / p.resolution).astype(np.int32)
            total = np.zeros(len(cells), dtype=np.float32)
            for offset in np.unique(offsets[:, 1] * columns + offsets[:, 0]):
                total += flat.take(base + offset)
            scores[number] = total
        centres = field_.floor_points()
        for _ in range(p.candidates):
            best, cell = np.unravel_index(int(np.argmax(scores)), scores.shape)
            if scores[best, cell] <= 0.0:
                return
            x, y = centres[cell].tolist()
            yield Pose2D(x, y, float(headings[best]))
            near = np.linalg.norm(centres - centres[cell], axis=1) < p.apart
            turns = np.abs((headings - headings[best] + math.pi) % (2 * math.pi) - math.pi) < p.turned_apart
            scores[np.ix_(turns, near)] = -1.0

    def matched(self, pose: Pose2D, position_std: float, heading_std: float, scan: LaserScan) -> LocalizationEstimate:
        """Return the pose near ``pose`` at which a scan fits best."""
        estimate = self._matcher.start(pose, Pose2D(), position_std, heading_std)
        for _ in range(self._search.matches):
            # Each time as unsure as before: the scan is one measurement, however often it is matched.
            unsure = self._matcher.start(estimate.pose, Pose2D(), position_std, heading_std)
            estimate = self._matcher.correct(unsure, scan, self._base_from_lidar)
        return estimate

    def fit(self, pose: Pose2D, scan: LaserScan) -> Agreement:
        """Return how well an earlier scan fits near its pose by odometry."""
        p = self._search
        matched = self.matched(pose, 0.25 * p.apart, 0.5 * p.heading_step, scan)
        return self.agreement(matched.pose, scan)

    def agreement(self, pose: Pose2D, scan: LaserScan) -> Agreement:
        """Return how well a scan fits at a pose of the base."""
        return self._search.beam_model.agreement(self._segments, pose @ self._base_from_lidar, scan)


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
    """Return points (N, 2) on the segments, at most ``step`` metres apart."""
    starts, ends = segments[:, :2], segments[:, 2:]
    counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / step).astype(int) + 1
    of = np.repeat(np.arange(len(segments)), counts)
    number = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (number / np.maximum(counts[of] - 1, 1))[:, None]
    points: NDArray[np.float64] = starts[of] + share * (ends - starts)[of]
    return points


def _indoors(distance: NDArray[np.float64], resolution: float) -> NDArray[np.bool_]:
    """Return the cells from which no way leads out of the map; all if the walls enclose nothing."""
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
