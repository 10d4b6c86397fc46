"""Pose estimation: which known object is this, and where exactly?"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class PoseHypothesis:
    """One model at one place, and how well that explains the image.

    ``pose``: frame_from_object. ``confidence``: probability, 0 to 1, that the model is right and the position good to
    a few millimetres. ``position_std``: metres, horizontal. ``yaw_std``: radians; π where the model has no yaw.
    ``yaw_alternatives``: other yaws, radians in the frame, that explain the image nearly as well and are no symmetry.
    The evidence: ``rmse`` metres between cluster and model; ``explained``: share of the cluster's points on the
    model; ``visible_fraction``: share of the model's camera-side surface that was measured there;
    ``floating``: share of that surface which would hover in front of measured depth; ``color_distance``: see the
    estimator. ``upright``: the model's z points up.
    """

    model: ObjectModel
    pose: Pose
    confidence: float
    position_std: float
    yaw_std: float
    rmse: float
    explained: float
    visible_fraction: float
    floating: float
    color_distance: float
    yaw_alternatives: tuple[float, ...] = ()
    upright: bool = True

    @property
    def ambiguous_yaw(self) -> bool:
        """Whether another view is needed to know the yaw."""
        return bool(self.yaw_alternatives)


class PoseEstimator(ABC):
    """Fits models of known objects to a cluster."""

    @abstractmethod
    def estimate(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        """The best pose of each model that could be this cluster, most confident first; empty where none could.

        ``view``: the view that the cluster was segmented from. Equal input gives equal output.
        """
