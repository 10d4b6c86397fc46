"""Localisation of the base on the map: localizers track it, global localizers find it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.navigation.localization.map_lines import PlanarMap
from bestman_bt.navigation.localization.pose_uncertainty import worst_position_std


def checked_std(value: float, what: str) -> float:
    """Return ``value``, a standard deviation. Raises ValueError naming ``what`` if it is negative or not finite."""
    if not 0.0 <= value < math.inf:
        raise ValueError(f"{what} is {value:g}; a finite number of 0 or more is accepted")
    return value


@dataclass(frozen=True)
class ScanMatch:
    """The quality of a scan match.

    ``accepted``: whether the estimate used it. ``inlier_ratio``: fraction of the hits on mapped surfaces, 0 to 1.
    ``residual``: their root mean square distance, metres. ``reason``: why it was refused, or empty.
    """

    accepted: bool
    inlier_ratio: float
    residual: float
    reason: str = ""


@dataclass(frozen=True, eq=False)
class LocalizationEstimate:
    """The estimated ``pose`` of the base in the map frame; ``covariance``: (3, 3) of x, y, theta in m², m rad, rad².

    ``match``: of the latest scan, None before the first.
    """

    pose: Pose2D
    covariance: NDArray[np.float64]
    match: ScanMatch | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, (3, 3), "LocalizationEstimate covariance"))

    @property
    def position_std(self) -> float:
        """Standard deviation along the worst direction, metres."""
        return worst_position_std(self.covariance)

    @property
    def heading_std(self) -> float:
        """Standard deviation of the heading, radians."""
        return math.sqrt(float(self.covariance[2, 2]))


class Localizer(ABC):
    """Tracks the base's pose: ``start`` once, then ``predict`` and ``correct`` for each reading.

    ``before``: the last estimate that one of them returned. All raise ValueError for values that are not finite.
    """

    @abstractmethod
    def start(self, pose: Pose2D, odometry: Pose2D, position_std: float, heading_std: float) -> LocalizationEstimate:
        """Return the first estimate, at ``pose`` in the map frame; ``odometry``: the odometry pose at the same moment.

        ``position_std``: metres, ``heading_std``: radians.
        """

    @abstractmethod
    def predict(self, before: Any, odometry: Pose2D) -> LocalizationEstimate:
        """Move the estimate by the change of the odometry pose (``odom`` frame) since ``before``."""

    @abstractmethod
    def correct(self, before: Any, scan: LaserScan, base_from_lidar: Pose2D) -> LocalizationEstimate:
        """Correct the estimate by a scan taken at the pose of ``before``."""

    def for_dragged_wheels(self) -> Localizer:
        """Return a localizer for wheels that slip sideways in turns (skid steering): with more noise of their odometry.

        By default itself: not every localizer relies on it.
        """
        return self


@dataclass(frozen=True, eq=False)
class OdometryScan:
    """A scan and the odometry pose (``odom`` frame) of the base when it was taken."""

    odometry: Pose2D
    scan: LaserScan


@dataclass(frozen=True)
class Place:
    """A possible place of the base: ``pose`` in the map frame, with its ``probability`` among all places.

    ``position_std`` metres, ``heading_std`` radians: of the pose given this place. ``explained``: fraction of the hits
    that the map explains there, 0 to 1.
    """

    pose: Pose2D
    probability: float
    position_std: float
    heading_std: float
    explained: float


class GlobalLocalizer(ABC):
    """Estimates the pose of the base on the whole map, without a prior."""

    @abstractmethod
    def locate(
        self, planar_map: PlanarMap, scans: Sequence[OdometryScan], base_from_lidar: Pose2D
    ) -> tuple[Place, ...]:
        """Return the possible places of the base at the last of ``scans``, the most probable first; may be empty.

        ``scans``: one or more, with the motion of the base in between.
        """
