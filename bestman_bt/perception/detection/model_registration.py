"""Detection by registration: every cluster on the surface is compared with every known model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import ObjectModel
from bestman_bt.perception.detection.base import DetectedScene, Detector
from bestman_bt.perception.detection.naming import NamingParameters, named_scene
from bestman_bt.perception.pose_estimation import MultiStart, PoseEstimator
from bestman_bt.perception.segmentation import PlaneDbscan, Region, Segmentation
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class ModelRegistrationParameters(NamingParameters):
    """As in NamingParameters."""


class ModelRegistration(Detector):
    """Segments, then names each cluster by the model that explains it best, if one does."""

    def __init__(
        self,
        parameters: ModelRegistrationParameters | None = None,
        segmentation: Segmentation | None = None,
        pose_estimator: PoseEstimator | None = None,
    ) -> None:
        self.parameters = parameters or ModelRegistrationParameters()
        self.segmentation = segmentation or PlaneDbscan()
        self.pose_estimator = pose_estimator or MultiStart()

    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        """See Detector."""
        scene = self.segmentation.segment(view, region, rng)
        found = [(cluster, self.pose_estimator.estimate(cluster, models, view)) for cluster in scene.clusters]
        return named_scene(scene, found, self.parameters)
