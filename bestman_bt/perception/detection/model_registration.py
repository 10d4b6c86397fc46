"""Detection by registration: every cluster on the surface is compared with every known model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from bestman_bt.messages import ObjectModel
from bestman_bt.perception.detection.base import DetectedScene, Detector
from bestman_bt.perception.detection.naming import Naming
from bestman_bt.perception.pose_estimation import MultiStart, PoseEstimator
from bestman_bt.perception.segmentation import PlaneDbscan, Region, Segmentation
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class ModelRegistration(Naming, Detector):
    """Segments, then names each cluster by the model that explains it best, if one does."""

    segmentation: Segmentation = field(default_factory=PlaneDbscan)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)

    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        """See Detector."""
        scene = self.segmentation.segment(view, region, rng)
        found = [(cluster, self.pose_estimator.estimate(cluster, models, view)) for cluster in scene.clusters]
        return self.named_scene(scene, found)
