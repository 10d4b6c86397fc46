"""Detection by registration: every cluster on the surface is compared with every known model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bestman_bt.messages import ObjectModel
from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector
from bestman_bt.perception.pose_estimation import MultiStart, PoseEstimator
from bestman_bt.perception.segmentation import Cluster, PlaneDbscan, Region, Segmentation
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class ModelRegistrationParameters:
    """``min_confidence``: below it a cluster is unknown.

    ``absorb_share``: a cluster belongs to a detected object where this share of its points lies in the object's
    bounding box, grown by ``absorb_margin`` metres (a cup may fall into its near and its far wall).
    """

    min_confidence: float = 0.5
    absorb_share: float = 0.8
    absorb_margin: float = 0.01


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
        found.sort(key=lambda item: -item[1][0].confidence if item[1] else 0.0)
        detections: list[Detection] = []
        unknown = []
        for cluster, hypotheses in found:
            if any(self._belongs(cluster, detection) for detection in detections):
                continue
            if hypotheses and hypotheses[0].confidence >= self.parameters.min_confidence:
                detections.append(Detection(cluster, hypotheses[0], hypotheses[1:]))
            else:
                unknown.append(cluster)
        return DetectedScene(scene, tuple(detections), tuple(unknown))

    def _belongs(self, cluster: Cluster, detection: Detection) -> bool:
        lower, upper = detection.hypothesis.model.bounds()
        points = detection.pose.inverse().apply(cluster.points)
        margin = self.parameters.absorb_margin
        inside = ((points > lower - margin) & (points < upper + margin)).all(axis=1)
        return bool(inside.mean() >= self.parameters.absorb_share)
