"""Pose estimation: identity and pose of known objects."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import ObjectModel, Pose, YawSet
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.view import View

AMBIGUOUS_YAW = math.radians(30.0)
"""Width of a yaw set above which another view is useful, radians."""


@dataclass(frozen=True, eq=False)
class PoseHypothesis:
    """A pose of one model, and how well it explains the image.

    ``pose``: frame_from_object, the most probable one. ``confidence``: probability, 0 to 1, that the model is right and
    the position accurate to a few millimetres. ``covariance``: (6, 6) of x, y, z and rotations about x, y, z of the
    frame, around ``pose`` (metres, radians); it is local: ambiguous yaws are in ``yaw_set``. ``yaw_set``: all yaws that
    explain the measurements nearly as well as the most probable one and are not symmetries of the model; empty if the
    model has no yaw.

    Evidence: ``rmse``: metres between cluster and model. ``explained``: fraction of the cluster's points on the model.
    ``visible_fraction``: fraction of the model's camera-side surface that was measured. ``floating``: fraction of that
    surface that would lie in front of measured depth. ``color_distance``: see the estimator. ``upright``: the model's z
    points up.
    """

    model: ObjectModel
    pose: Pose
    confidence: float
    covariance: NDArray[np.float64]
    yaw_set: YawSet
    rmse: float
    explained: float
    visible_fraction: float
    floating: float
    color_distance: float
    upright: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, (6, 6), "PoseHypothesis covariance"))

    @property
    def position_std(self) -> float:
        """Standard deviation of the horizontal position, mean of both axes, metres."""
        return math.sqrt(float(self.covariance[0, 0] + self.covariance[1, 1]) / 2.0)

    @property
    def yaw_std(self) -> float:
        """Standard deviation of the yaw about ``pose``, radians; π if the model has no yaw."""
        return min(math.pi, math.sqrt(float(self.covariance[5, 5])))

    @property
    def ambiguous_yaw(self) -> bool:
        """Return whether the yaw needs another view."""
        return self.yaw_set.width > AMBIGUOUS_YAW


class PoseEstimator(ABC):
    """Fits models of known objects to a cluster."""

    @abstractmethod
    def estimate(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        """Return the best pose of each model that could explain the cluster, most confident first; may be empty.

        ``view``: the view that the cluster was segmented from. Equal input gives equal output.
        """
