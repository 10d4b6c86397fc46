"""From pose hypotheses for each cluster to a scene with names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from bestman_bt.perception.detection.base import DetectedScene, Detection
from bestman_bt.perception.pose_estimation import PoseHypothesis
from bestman_bt.perception.segmentation import Cluster, SegmentedScene


@dataclass(frozen=True)
class Naming:
    """Names clusters by their hypotheses. ``min_confidence``: below it a cluster is unknown.

    ``absorb_share``: a cluster belongs to a detected object where this share of its points lies in the object's
    bounding box, grown by ``absorb_margin`` metres (a cup may fall into its near and its far wall).
    """

    min_confidence: float = 0.5
    absorb_share: float = 0.8
    absorb_margin: Annotated[float, "m"] = 0.01

    def named_scene(
        self, scene: SegmentedScene, found: Sequence[tuple[Cluster, tuple[PoseHypothesis, ...]]]
    ) -> DetectedScene:
        """Name each cluster by its first hypothesis where that is sure enough; the surest clusters come first."""
        order = sorted(found, key=lambda item: -item[1][0].confidence if item[1] else 0.0)
        detections: list[Detection] = []
        unknown = []
        for cluster, hypotheses in order:
            if any(self._belongs(cluster, detection) for detection in detections):
                continue
            if hypotheses and hypotheses[0].confidence >= self.min_confidence:
                detections.append(Detection(cluster, hypotheses[0], hypotheses[1:]))
            else:
                unknown.append(cluster)
        return DetectedScene(scene, tuple(detections), tuple(unknown))

    def _belongs(self, cluster: Cluster, detection: Detection) -> bool:
        lower, upper = detection.hypothesis.model.bounds()
        points = detection.pose.inverse().apply(cluster.points)
        inside = ((points > lower - self.absorb_margin) & (points < upper + self.absorb_margin)).all(axis=1)
        return bool(inside.mean() >= self.absorb_share)
