"""2D lidar SLAM: scan-to-submap matching, a pose graph of submaps and keyframes, and loop closures.

The local frame is smooth and drifts: scan matching and odometry are fused in it. The map frame is that of the optimised
graph (as in W. Hess et al., "Real-time loop closure in 2D lidar SLAM", 2016).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import LaserScan, OccupancyGrid, Pose2D, wrap_angle
from bestman_bt.messages.grids import FREE, OCCUPIED, UNKNOWN
from bestman_bt.messages.shapes import Count, Fraction, NonNegative, NotBelow, Positive, Several, check_bounds
from bestman_bt.navigation.localization.base import Localizer, ScanMatch, checked_std
from bestman_bt.navigation.localization.pose_uncertainty import (
    WEAK_PRIOR,
    deviation,
    difference,
    driven_on,
    inverse,
    turned,
    worst_position_std,
)
from bestman_bt.navigation.slam.base import Slam, SlamEstimate, SlamTrajectory
from bestman_bt.navigation.slam.correlative import LikelihoodPyramid, SearchWindow
from bestman_bt.navigation.slam.loop_closure import LoopCloser
from bestman_bt.navigation.slam.point_to_line import OrientedPoints, PointToLine, ScanAlignment, oriented_points
from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph
from bestman_bt.navigation.slam.submap import Keyframe, Submap


@dataclass(frozen=True, eq=False)
class LocatedEstimate(SlamEstimate):
    """``odometry``: the odometry pose (``odom`` frame) at ``pose``."""

    odometry: Pose2D = field(default_factory=Pose2D)


@dataclass(frozen=True, eq=False)
class SlamLocalizer(Localizer):
    """Feeds ``slam``; the map's frame is that of the believed pose at ``start``."""

    slam: Slam

    @override
    def start(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> LocatedEstimate:
        """Start a new map, on which the base is exactly at ``pose``."""
        checked_std(position_std, "SlamLocalizer position_std")
        checked_std(heading_std, "SlamLocalizer heading_std")
        return _located(self.slam.reset(pose, odometry), odometry)

    @override
    def predict(self, before: LocatedEstimate, odometry: Pose2D) -> LocatedEstimate:
        return _located(self.slam.predict(odometry), odometry)

    @override
    def correct(self, before: LocatedEstimate, scan: LaserScan, base_from_lidar: Pose2D) -> LocatedEstimate:
        return _located(self.slam.add(before.odometry, scan, base_from_lidar), before.odometry)


def _located(estimate: SlamEstimate, odometry: Pose2D) -> LocatedEstimate:
    return LocatedEstimate(estimate.pose, estimate.covariance, estimate.match, estimate.loop_closures, odometry)


GROWTH = 16
"""Number of cells by which the grid grows at a time."""


@dataclass(eq=False)
class LogOddsGrid:
    """A growing log-odds grid (H. Moravec, A. Elfes, 1985). Each scan counts once per cell, as a hit if it is both hit
    and passed.

    ``resolution``: metres per cell. ``hit``, ``miss``: log odds that a scan adds to a cell that it hits or passes.
    ``limit``: bound of the log odds, so that changes are accepted after a while. A cell is occupied at log odds of at
    least ``occupied`` (one hit), free at most -``free`` (one pass). ``keep``: metres before a hit that a beam does not
    clear: its noise, and a grazed wall. ``border``: metres of unknown space around all seen cells, to search but not to
    drive into.
    """

    resolution: Annotated[Positive, "m per cell"] = 0.05
    hit: Positive = 0.85
    miss: Positive = 0.3
    limit: Annotated[Positive, NotBelow("occupied"), NotBelow("free")] = 4.0
    occupied: Positive = 0.8
    free: Positive = 0.25
    keep: Annotated[NonNegative, "m"] = 0.06
    border: Annotated[NonNegative, "m"] = 2.0

    def __post_init__(self) -> None:
        check_bounds(self)
        self._log_odds = np.zeros((0, 0))
        self._seen = np.zeros((0, 0), dtype=bool)
        self._first = np.zeros(2, dtype=np.intp)  # column and row of cell (0, 0), counted from the map's origin

    def add(self, map_from_lidar: Pose2D, scan: LaserScan) -> None:
        """Add a scan taken at ``map_from_lidar``.

        Beams without a hit are ignored: they may be due to glass or the robot itself.
        """
        hit = np.isfinite(scan.ranges)
        ranges = scan.ranges[hit]
        heading = scan.angles[hit] + map_from_lidar.theta
        directions = np.column_stack([np.cos(heading), np.sin(heading)])
        step = 0.7 * self.resolution
        along = np.arange(0.0, float(ranges.max(initial=0.0)), step)
        passed = along[None] < (ranges - self.keep)[:, None]
        beam, sample = np.nonzero(passed)
        free = self._cells(map_from_lidar.xy + along[sample, None] * directions[beam])
        ends = self._cells(map_from_lidar.xy + ranges[:, None] * directions)
        self._grow(np.concatenate([free, ends]))
        touched = np.zeros(self._log_odds.shape, dtype=np.int8)
        touched[tuple((free - self._first).T[::-1])] = 1
        touched[tuple((ends - self._first).T[::-1])] = 2
        change = np.array([0.0, -self.miss, self.hit])
        self._log_odds = np.clip(self._log_odds + change[touched], -self.limit, self.limit)
        self._seen |= touched > 0

    def grid(self) -> OccupancyGrid:
        """Return the cells that are believed occupied and free; the others are unknown."""
        data = np.full(self._log_odds.shape, UNKNOWN, dtype=np.int8)
        data[self._seen & (self._log_odds <= -self.free)] = FREE
        data[self._log_odds >= self.occupied] = OCCUPIED
        return OccupancyGrid(data, self.resolution, np.asarray(self._first * self.resolution, dtype=np.float64))

    def _cells(self, points: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return (N, 2) column and row from the map's origin."""
        return np.floor(points / self.resolution).astype(np.intp)

    def _grow(self, cells: NDArray[np.intp]) -> None:
        if len(cells) == 0:
            return
        border = round(self.border / self.resolution)
        low, high = cells.min(axis=0) - border, cells.max(axis=0) + 1 + border
        if self._log_odds.size:
            old_high = self._first + self._log_odds.shape[::-1]
            before = -(-np.maximum(self._first - low, 0) // GROWTH) * GROWTH
            after = -(-np.maximum(high - old_high, 0) // GROWTH) * GROWTH
        else:
            self._first = low
            before, after = np.zeros(2, dtype=np.intp), high - low
        if before.any() or after.any():
            padding = ((before[1], after[1]), (before[0], after[0]))
            self._log_odds = np.pad(self._log_odds, padding)
            self._seen = np.pad(self._seen, padding)
            self._first = self._first - before


@dataclass
class _Closing:
    """Loops that are looked for with ``keyframe``; ``scans``: that came since."""

    keyframe: Keyframe
    found: Future[tuple[list[Constraint], NDArray[np.float64]]]
    scans: int = 0


@dataclass(eq=False)
class PoseGraphSlam(Slam):
    """Matches scans to submaps and closes loops in a graph of their poses; equal input gives equal output.

    Lengths in metres, angles in radians.

    ``loop_closure``: False leaves only scan matching, as a control. A scan becomes a keyframe after
    ``keyframe_distance`` or ``keyframe_angle``; a submap has ``submap_keyframes``, and its second half is the first
    half of the next. ``cell``: points of a submap nearer than this are merged. ``min_hits``: smallest number of hits on
    lines in a scan. ``slip``, ``turn_slip``, ``turn_shift``, ``drift``: variance added by odometry, for wheels that
    slip by 10 %; ``rest_std``, ``rest_heading_std``: the same at rest. If a match explains less than
    ``min_inlier_ratio`` of the hits, a window of ``recovery_distance`` and ``recovery_angle`` is searched; a result has
    to explain ``sure_inlier_ratio`` and have a standard deviation of at most ``sure_std`` in each direction. Otherwise
    the match is accepted if it explains ``least_inlier_ratio``, as when a new room comes into view, and is within
    ``max_deviation`` of the odometry. ``position_std``, ``heading_std``: error of a match in addition to the noise of
    the hits. ``redraw_distance``, ``redraw_angle``: a keyframe that a loop closure moves further triggers a new grid.
    ``closing_scans``: number of scans after which, or at the next keyframe if earlier, the loop closures found and
    solved by a separate thread are applied.
    """

    loop_closure: bool = True
    keyframe_distance: Annotated[Positive, "m"] = 0.30
    keyframe_angle: Annotated[Positive, "rad"] = math.radians(20.0)
    submap_keyframes: Several = 16
    cell: Annotated[Positive, "m"] = 0.02
    min_hits: Count = 20
    slip: Annotated[NonNegative, "m²/m"] = 6e-4
    turn_slip: Annotated[NonNegative, "rad²/rad"] = 1e-3
    turn_shift: Annotated[NonNegative, "m²/rad"] = 0.0
    drift: Annotated[NonNegative, "rad²/m"] = 4e-4
    rest_std: Annotated[NonNegative, "m"] = 0.002
    rest_heading_std: Annotated[NonNegative, "rad"] = 0.002
    min_inlier_ratio: Annotated[Fraction, NotBelow("least_inlier_ratio")] = 0.45
    least_inlier_ratio: Fraction = 0.20
    sure_inlier_ratio: Annotated[Fraction, NotBelow("min_inlier_ratio")] = 0.60
    sure_std: Annotated[Positive, "m"] = 0.03
    max_deviation: Positive = 3.0
    recovery_distance: Annotated[NonNegative, "m"] = 0.6
    recovery_angle: Annotated[NonNegative, "rad"] = math.radians(30.0)
    position_std: Annotated[NonNegative, "m"] = 0.004
    heading_std: Annotated[NonNegative, "rad"] = math.radians(0.08)
    redraw_distance: Annotated[NonNegative, "m"] = 0.015
    redraw_angle: Annotated[NonNegative, "rad"] = math.radians(0.15)
    closing_scans: Count = 3
    line: PointToLine = field(default_factory=PointToLine)
    correlative: LikelihoodPyramid = field(default_factory=LikelihoodPyramid)
    closure: LoopCloser = field(default_factory=LoopCloser)
    graph: PoseGraph = field(default_factory=PoseGraph)
    occupancy: LogOddsGrid = field(default_factory=LogOddsGrid)

    def __post_init__(self) -> None:
        self._estimate: SlamEstimate | None = None
        self._closing: _Closing | None = None

    def reset(self, pose: Pose2D, odometry: Pose2D) -> SlamEstimate:
        """Implement ``Slam.reset``."""
        self._odometry, self._local = odometry.checked("PoseGraphSlam odometry"), pose.checked("PoseGraphSlam pose")
        self._graph = replace(self.graph)  # an empty one
        self._keyframes: list[Keyframe] = []
        self._active: list[Submap] = []
        self._finished: list[Submap] = []
        self._loops: list[tuple[int, int]] = []
        # A loop of a large house takes longer to close than a tick may.
        self._worker, self._closing = ThreadPoolExecutor(1, "slam"), None
        self._map_from_local = Pose2D()
        self._covariance = self._error(self.position_std, self.heading_std)
        self._drawing, self._drawn = replace(self.occupancy), np.zeros((0, 3))
        return self._report(None)

    @property
    def estimate(self) -> SlamEstimate:
        """Implement ``Slam.estimate``."""
        if self._estimate is None:
            raise RuntimeError("PoseGraphSlam was used before reset")
        return self._estimate

    def predict(self, odometry: Pose2D) -> SlamEstimate:
        """Implement ``Slam.predict``."""
        estimate = self.estimate
        moved = self._odometry.inverse() @ odometry.checked("PoseGraphSlam odometry")
        self._odometry = odometry
        if moved == Pose2D():
            return estimate
        self._local, self._covariance = driven_on(self._local, self._covariance, moved, self)
        return self._report(estimate.match)

    def add(self, odometry: Pose2D, scan: LaserScan, base_from_lidar: Pose2D) -> SlamEstimate:
        """Implement ``Slam.add``."""
        base_from_lidar.checked("PoseGraphSlam base_from_lidar")
        if self._closing is not None:
            self._closing.scans += 1
            if self._closing.scans >= self.closing_scans:
                self._take_closures()
        self.predict(odometry)
        hits = oriented_points(scan, base_from_lidar)
        if len(hits) < self.min_hits:
            return self._report(ScanMatch(False, 0.0, math.inf, f"only {len(hits)} hits lie on lines"))
        if not self._active:
            self._insert(Keyframe(self._graph.add_pose(self._local), self._local, scan, base_from_lidar, hits))
            return self._report(ScanMatch(True, 1.0, 0.0))
        match = self._match(hits)
        if match.accepted and self._is_new_place():
            self._add_keyframe(scan, base_from_lidar, hits)
        return self._report(match)

    @property
    def grid(self) -> OccupancyGrid:
        """Implement ``Slam.grid``."""
        poses = self._graph.poses
        old = poses[: len(self._drawn)]
        change = np.abs(old - self._drawn)
        turn = np.abs((change[:, 2] + np.pi) % (2.0 * np.pi) - np.pi)
        if (change[:, :2] > self.redraw_distance).any() or (turn > self.redraw_angle).any():
            self._drawing, self._drawn = replace(self.occupancy), np.zeros((0, 3))
        for keyframe in self._keyframes[len(self._drawn) :]:
            self._drawing.add(self._graph.pose(keyframe.node) @ keyframe.base_from_lidar, keyframe.scan)
        self._drawn = np.vstack([self._drawn, poses[len(self._drawn) :]])
        return self._drawing.grid()

    @property
    def trajectory(self) -> SlamTrajectory:
        """Implement ``Slam.trajectory``."""
        self._take_closures()
        stamps = np.array([keyframe.scan.stamp for keyframe in self._keyframes])
        return SlamTrajectory(self._graph.poses, stamps, np.array(self._loops, dtype=np.intp).reshape(-1, 2))

    def _match(self, hits: OrientedPoints) -> ScanMatch:
        """Match to the older of the current submaps, and adopt the result if it is plausible."""
        submap = self._active[0]
        anchor = submap.anchor.local.theta
        guess = submap.pose_of(self._local)
        expected = turned(self._covariance + self._error(self.rest_std, self.rest_heading_std), -anchor)
        prior = inverse(expected)
        found = submap.reference.align(hits, guess, prior)
        if found.inlier_ratio < self.min_inlier_ratio:
            elsewhere = self._search(hits, guess, submap)
            if elsewhere is not None:
                found, prior = elsewhere, WEAK_PRIOR
            elif not self._is_likely(found, difference(found.pose, guess), expected):
                text = f"only {found.inlier_ratio:.0%} of the hits lie on what was mapped lately"
                return ScanMatch(False, found.inlier_ratio, found.residual, text)
        self._local = submap.anchor.local @ found.pose
        covariance = inverse(found.information + prior)
        self._covariance = turned(covariance, anchor) + self._error(self.position_std, self.heading_std)
        return ScanMatch(True, found.inlier_ratio, found.residual)

    def _search(self, hits: OrientedPoints, guess: Pose2D, submap: Submap) -> ScanAlignment | None:
        """Return the pose of the scan after a jump, or None if it is ambiguous."""
        coarse = submap.matcher.search(hits.points, guess, SearchWindow(self.recovery_distance, self.recovery_angle))
        if coarse is None:
            return None
        found = submap.reference.align(hits, coarse.pose)
        if found.inlier_ratio < self.sure_inlier_ratio:
            return None
        return found if worst_position_std(inverse(found.information + WEAK_PRIOR)) < self.sure_std else None

    def _is_likely(self, found: ScanAlignment, off: NDArray[np.float64], expected: NDArray[np.float64]) -> bool:
        """Return whether a match that explains little, ``off`` from what the odometry says, is believed all the
        same.
        """
        return found.inlier_ratio >= self.least_inlier_ratio and deviation(off, expected) <= self.max_deviation

    def _is_new_place(self) -> bool:
        last = self._keyframes[-1].local
        turn = abs(wrap_angle(self._local.theta - last.theta))
        return last.distance_to(self._local) > self.keyframe_distance or turn > self.keyframe_angle

    def _add_keyframe(self, scan: LaserScan, base_from_lidar: Pose2D, hits: OrientedPoints) -> None:
        self._take_closures()
        node = self._graph.add_pose(self._map_from_local @ self._local)
        keyframe = Keyframe(node, self._local, scan, base_from_lidar, hits)
        information = inverse(turned(self._covariance, -self._local.theta))
        for submap in self._active:
            self._graph.add_constraint(
                Constraint(submap.anchor.node, node, submap.pose_of(self._local), information / len(self._active))
            )
        self._insert(keyframe)
        if self.loop_closure:
            found = self._worker.submit(self._close, keyframe, tuple(self._finished), self._graph.copy())
            self._closing = _Closing(keyframe, found)

    def _close(
        self, keyframe: Keyframe, finished: Sequence[Submap], graph: PoseGraph
    ) -> tuple[list[Constraint], NDArray[np.float64]]:
        """Return the loops that ``keyframe`` closes, and all poses after that; ``graph`` is a copy, nothing else
        changes.
        """
        closures = self.closure.find(keyframe, finished, graph)
        for closure in closures:
            graph.add_constraint(closure)
        if closures:
            graph.optimize()
        return closures, graph.poses

    def _take_closures(self) -> None:
        """Wait for the running computation and adopt its result, so that equal scans give equal maps regardless of its
        duration.
        """
        if self._closing is None:
            return
        (closures, poses), keyframe, self._closing = self._closing.found.result(), self._closing.keyframe, None
        for closure in closures:
            self._graph.add_constraint(closure)
            self._loops.append((closure.first, closure.second))
        if closures:
            self._graph.move_to(poses)
            self._map_from_local = self._graph.pose(keyframe.node) @ keyframe.local.inverse()
            self._report(self.estimate.match)

    def _insert(self, keyframe: Keyframe) -> None:
        self._keyframes.append(keyframe)
        for submap in self._active:
            submap.insert(keyframe)
        if not self._active or len(self._active[-1].keyframes) >= self.submap_keyframes // 2:
            begun = Submap(self.line, self.correlative, self.cell)
            begun.insert(keyframe)
            self._active.append(begun)
        if len(self._active[0].keyframes) >= self.submap_keyframes:
            self._finished.append(self._active.pop(0))

    def _error(self, position: float, heading: float) -> NDArray[np.float64]:
        return np.diag([position**2, position**2, heading**2])

    def _report(self, match: ScanMatch | None) -> SlamEstimate:
        covariance = turned(self._covariance, self._map_from_local.theta)
        self._estimate = SlamEstimate(self._map_from_local @ self._local, covariance, match, len(self._loops))
        return self._estimate
