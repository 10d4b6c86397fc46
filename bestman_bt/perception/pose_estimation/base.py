"""Pose estimation: which known object is this, and where exactly?"""

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
"""Width of a yaw set beyond which another view is worth taking."""


@dataclass(frozen=True, eq=False)
class PoseHypothesis:
    """One model at one place, and how well that explains the image.

    ``pose``: frame_from_object, the likeliest. ``confidence``: probability, 0 to 1, that the model is right and the
    position good to a few millimetres. ``covariance``: (6, 6) of x, y, z, and turns about x, y, z of the frame, around
    ``pose`` (metres, radians; local: other yaws that the view leaves open are in ``yaw_set``). ``yaw_set``: all yaws
    that explain what was seen nearly as well as the likeliest and are no symmetry of the model; empty where it has
    no yaw.
    The evidence: ``rmse`` metres between cluster and model; ``explained``: share of the cluster's points on the
    model; ``visible_fraction``: share of the model's camera-side surface that was measured there;
    ``floating``: share of that surface which would hover in front of measured depth; ``color_distance``: see the
    estimator. ``upright``: the model's z points up.
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
        """Metres, horizontal, each axis on average."""
        return math.sqrt(float(self.covariance[0, 0] + self.covariance[1, 1]) / 2.0)

    @property
    def yaw_std(self) -> float:
        """Radians, about ``pose``; π where the model has no yaw."""
        return min(math.pi, math.sqrt(float(self.covariance[5, 5])))

    @property
    def ambiguous_yaw(self) -> bool:
        """Return whether the yaw needs another view."""
        return self.yaw_set.width > AMBIGUOUS_YAW


class PoseEstimator(ABC):
    """Fits models of known objects to a cluster."""

    @abstractmethod
    def estimate(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        """Return the best pose of each model that could be this cluster, most confident first; empty where none could.

        ``view``: the view that the cluster was segmented from. Equal input gives equal output.
        """
