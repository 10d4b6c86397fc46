"""Submaps: the points of consecutive keyframes in the frame of the first, rigid once they are finished.

As in W. Hess et al., "Real-time loop closure in 2D lidar SLAM", 2016: drift inside a submap is small, so that
corrections only move submaps relative to each other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.navigation.slam.correlative import CorrelativeMatcher, LikelihoodPyramid
from bestman_bt.navigation.slam.point_to_line import LineReference, OrientedPoints, PointToLine, joined, thinned


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A stored scan. ``node``: in the pose graph. ``local``: pose of the base in the smoothly drifting frame.

    ``hits``: of the scan, in the base frame.
    """

    node: int
    local: Pose2D
    scan: LaserScan
    base_from_lidar: Pose2D
    hits: OrientedPoints


@dataclass(eq=False)
class Submap:
    """A local map of ``keyframes``, in the frame of the first. ``cell``: metres within which points are merged."""

    line: PointToLine
    correlative: LikelihoodPyramid
    cell: float
    keyframes: list[Keyframe] = field(default_factory=list)

    @property
    def anchor(self) -> Keyframe:
        """The keyframe whose base frame is the submap's."""
        return self.keyframes[0]

    @property
    def last_node(self) -> int:
        """The node of its newest keyframe in the pose graph."""
        return self.keyframes[-1].node

    def insert(self, keyframe: Keyframe) -> None:
        """Add the points of a keyframe at its local pose."""
        self.keyframes.append(keyframe)
        for name in ("cloud", "reference", "matcher"):
            self.__dict__.pop(name, None)

    def pose_of(self, local: Pose2D) -> Pose2D:
        """Return a pose of the local frame in that of the submap."""
        return self.anchor.local.inverse() @ local

    @cached_property
    def cloud(self) -> OrientedPoints:
        """All points, in the submap's frame."""
        return thinned(joined([k.hits.placed(self.pose_of(k.local)) for k in self.keyframes]), self.cell)

    @cached_property
    def reference(self) -> LineReference:
        """Return the reference for ICP."""
        return LineReference(self.cloud, self.line)

    @cached_property
    def matcher(self) -> CorrelativeMatcher:
        """Return the matcher for large displacements."""
        return CorrelativeMatcher(self.cloud.points, self.correlative)

    def distance_to(self, point: Pose2D) -> float:
        """Return the distance from a pose in the submap's frame to the nearest of its keyframes, metres."""
        places = np.array([self.pose_of(k.local).xy for k in self.keyframes])
        return float(np.linalg.norm(places - point.xy, axis=1).min())
