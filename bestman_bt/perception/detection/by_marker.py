"""Detection of objects by the markers that they carry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from bestman_bt.messages import ObjectModel
from bestman_bt.perception.detection.aruco import MarkerDetection, MarkerDetector
from bestman_bt.perception.detection.base import DetectedScene, Detector, LabelledCluster
from bestman_bt.perception.detection.from_image import located
from bestman_bt.perception.pose_estimation import MultiStart, PoseEstimator
from bestman_bt.perception.segmentation import Cluster, Region, RegionGrowing, Segmentation
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class ByMarker(MarkerDetector, Detector):
    """A cluster on which a marker shows has the name that the marker stands for; the pose comes from its model.

    A marker with no cluster under it, for example on the table itself, names nothing.

    ``markers``: the object's name by the marker's id. ``min_points``: of a cluster that show inside of the marker.
    ``min_confidence``: of the pose, below which a thing only has its name.
    """

    markers: Mapping[int, str] = field(default_factory=dict)
    min_points: int = 5
    min_confidence: float = 0.5
    segmentation: Segmentation = field(default_factory=RegionGrowing)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)

    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        """See Detector."""
        scene = self.segmentation.segment(view, region, rng)
        rest = list(scene.clusters)
        labelled = []
        for marker in self.find(view.image):
            if marker.id not in self.markers or not rest:
                continue
            counts = [_inside(cluster, marker, view) for cluster in rest]
            best = int(np.argmax(counts))
            if counts[best] >= self.min_points:
                thing = rest.pop(best)
                name = self.markers[marker.id]
                labelled.append(
                    LabelledCluster(thing.points, thing.colors, thing.plane, thing.at_border, name, score=1.0)
                )
        return located(scene, labelled, rest, models, self.pose_estimator, view, self.min_confidence)


def _inside(cluster: Cluster, marker: MarkerDetection, view: View) -> int:
    """How many points of the cluster the camera sees inside of the marker's square."""
    pixels, _ = view.project(cluster.points)
    quad = cv2.convexHull(marker.corners.astype(np.float32))[:, 0]
    edges = np.roll(quad, -1, axis=0) - quad
    offsets = pixels[:, None] - quad[None]
    sides = edges[None, :, 0] * offsets[:, :, 1] - edges[None, :, 1] * offsets[:, :, 0]
    return int(((sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)).sum())
