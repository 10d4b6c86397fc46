"""Converts named boxes and masks of an image to objects with poses: assigns the cluster and registers the model."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import ObjectModel, PointCloud, RGBDImage
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector, LabelledCluster, Naming
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.base import PoseEstimator
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation, SegmentedScene, voxel_means
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class ModelRegistration(Naming, Detector):
    """Segments the view, then labels each cluster with the model that explains it best, if any."""

    segmentation: Segmentation = field(default_factory=PlaneDbscan)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)

    @override
    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        scene = self.segmentation.segment(view, region, rng)
        found = [(cluster, self.pose_estimator.estimate(cluster, models, view)) for cluster in scene.clusters]
        return self.named_scene(scene, found)


@dataclass(frozen=True, eq=False)
class ImageDetection:
    """A labelled part of an image.

    ``score``: 0 to 1. ``box``: left, top, right, bottom in pixels; pixel (u, v) covers u - 0.5 to u + 0.5. ``mask``:
    (H, W) bool of the whole image, or None if only the box is known. Raises PerceptionError for an invalid score or
    box.
    """

    label: str
    score: float
    box: tuple[float, float, float, float]
    mask: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        left, top, right, bottom = self.box
        if not (np.isfinite(self.box).all() and left < right and top < bottom):
            raise PerceptionError(
                f"ImageDetection {self.label!r}: box should be left < right, top < bottom: {self.box}"
            )
        if not 0.0 <= self.score <= 1.0:
            raise PerceptionError(f"ImageDetection {self.label!r}: score should be 0 to 1 but is {self.score}")
        if self.mask is not None:
            object.__setattr__(self, "mask", frozen_array(self.mask, (None, None), "ImageDetection mask", np.bool_))

    def clipped(self, width: int, height: int) -> ImageDetection | None:
        """Return the part inside an image of ``width`` by ``height`` pixels, or None if the box lies outside."""
        left, right = (float(np.clip(value, -0.5, width - 0.5)) for value in (self.box[0], self.box[2]))
        top, bottom = (float(np.clip(value, -0.5, height - 0.5)) for value in (self.box[1], self.box[3]))
        if left >= right or top >= bottom:
            return None
        return replace(self, box=(left, top, right, bottom))

    def holds(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which of the pixels (N, 2), as (u, v), lie in the mask, or without a mask in the box, (N,) bool; NaN
        lies in neither.
        """
        left, top, right, bottom = self.box
        u, v = pixels[:, 0], pixels[:, 1]
        inside: NDArray[np.bool_] = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
        if self.mask is not None:
            height, width = self.mask.shape
            nearest = np.rint(np.where(inside[:, None], pixels, 0.0)).astype(np.intp)
            nearest = np.clip(nearest, 0, (width - 1, height - 1))
            inside &= self.mask[nearest[:, 1], nearest[:, 0]]
        return inside


@dataclass(frozen=True)
class FromImage(Detector):
    """Base class of detectors that label objects in the colour image; it finds the cluster and the pose of each.

    A label without a pose gives a LabelledCluster among the unknown; clusters without a label are plain Clusters there.

    ``names``: further objects to search for, without a model. ``prompts``: object name → query for the detector.
    ``min_score``: minimum score in the image; ``min_confidence``: minimum confidence of a pose, below which an object
    only gets its label. ``whole_share``: fraction of a cluster that must lie in the box or mask. ``min_overlap``:
    minimum intersection over union of a box without mask and the box of the cluster. ``min_points``: minimum voxels of
    a cluster cut out by a mask. ``voxel``: edge length, metres.
    """

    names: tuple[str, ...] = ()
    prompts: Mapping[str, str] = field(default_factory=dict)
    min_score: float = 0.3
    min_confidence: float = 0.5
    whole_share: float = 0.7
    min_overlap: float = 0.3
    min_points: int = 30
    voxel: Annotated[float, "m"] = 0.004
    segmentation: Segmentation = field(default_factory=RegionGrowing)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)

    @abstractmethod
    def find(self, image: RGBDImage, names: Sequence[str]) -> tuple[ImageDetection, ...]:
        """Return the detections of ``names`` in the image, highest score first; may be empty.

        Raises PerceptionError, with the reason, if the detector cannot run.
        """

    @override
    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        scene = self.segmentation.segment(view, region, rng)
        labelled, rest = self._labelled(scene, view, region, models)
        return located(scene, labelled, rest, models, self.pose_estimator, view, self.min_confidence)

    def seen(self, view: View, models: Sequence[ObjectModel]) -> tuple[ImageDetection, ...]:
        """Return the detections in the image, by the objects' names, highest score first."""
        name_of = {self.prompts.get(name, name): name for name in (*(model.name for model in models), *self.names)}
        if not name_of:
            return ()
        k = view.image.intrinsics
        found = []
        for detection in self.find(view.image, list(name_of)):
            clipped = detection.clipped(k.width, k.height)
            if clipped is not None and detection.score >= self.min_score and detection.label in name_of:
                found.append(ImageDetection(name_of[detection.label], detection.score, clipped.box, clipped.mask))
        return tuple(sorted(found, key=lambda detection: -detection.score))

    def _labelled(
        self, scene: SegmentedScene, view: View, region: Region, models: Sequence[ObjectModel]
    ) -> tuple[list[LabelledCluster], list[Cluster]]:
        """Return clusters with labels, and the remaining clusters."""
        rest = list(scene.clusters)
        labelled = []
        for detection in self.seen(view, models):
            pixels = [view.project(cluster.points)[0] for cluster in rest]
            inside = [detection.holds(some) for some in pixels]
            counts = [int(held.sum()) for held in inside]
            best = int(np.argmax(counts)) if counts else 0
            if counts and inside[best].mean() >= self.whole_share:
                if detection.mask is not None or _overlap(detection.box, pixels[best]) >= self.min_overlap:
                    labelled.append(_with_label(rest.pop(best), detection))
            elif detection.mask is not None and counts and counts[best] >= self.min_points:
                cluster = rest.pop(best)
                rest += [part for part in [_part(cluster, ~inside[best])] if len(part.points) >= self.min_points]
                labelled.append(_with_label(_part(cluster, inside[best]), detection))
            elif detection.mask is not None and not self._segmented(detection, scene, view):
                flat = self._cut_out(detection, scene, view, region)
                if flat is not None:
                    labelled.append(_with_label(flat, detection))
        return labelled, rest

    def _segmented(self, detection: ImageDetection, scene: SegmentedScene, view: View) -> bool:
        """Return whether the segmentation found what the mask shows, whichever object has its name by now."""
        pixels = [view.project(cluster.points)[0] for cluster in scene.clusters]
        return sum(int(detection.holds(some).sum()) for some in pixels) >= self.min_points

    def _cut_out(self, detection: ImageDetection, scene: SegmentedScene, view: View, region: Region) -> Cluster | None:
        """Return the points of a mask on or above the surface: a thing too flat for the segmentation."""
        plane = scene.planes[0]
        points, _, (rows, columns) = view.organised(region.corners())
        assert detection.mask is not None
        local = plane.frame_from_plane.inverse().apply(points)
        held = detection.mask[rows, columns] & (local[..., 2] > -0.005) & (local[..., 2] < region.height)
        held &= (np.abs(local[..., 0]) < plane.size[0] / 2) & (np.abs(local[..., 1]) < plane.size[1] / 2)
        cloud = voxel_means(PointCloud(points[held], view.image.rgb[rows, columns][held]), self.voxel)
        if len(cloud) < self.min_points or cloud.colors is None:
            return None
        height, width = detection.mask.shape
        left, top, right, bottom = detection.box
        at_border = min(left, top, width - 1 - right, height - 1 - bottom) < 3.0
        return Cluster(cloud.points, cloud.colors, plane, at_border)


def located(
    scene: SegmentedScene,
    labelled: Sequence[LabelledCluster],
    rest: Sequence[Cluster],
    models: Sequence[ObjectModel],
    pose_estimator: PoseEstimator,
    view: View,
    min_confidence: float,
) -> DetectedScene:
    """Return a scene in which labelled clusters have poses, if a model of that name exists and fits."""
    model_of = {model.name: model for model in models}
    detections: list[Detection] = []
    unknown: list[Cluster] = []
    for cluster in labelled:
        known = [model_of[cluster.label]] if cluster.label in model_of else []
        hypotheses = pose_estimator.estimate(cluster, known, view) if known else ()
        if hypotheses and hypotheses[0].confidence >= min_confidence:
            detections.append(Detection(cluster, hypotheses[0], hypotheses[1:]))
        else:
            unknown.append(cluster)
    detections.sort(key=lambda detection: -detection.confidence)
    return DetectedScene(scene, tuple(detections), (*unknown, *rest))


def _with_label(cluster: Cluster, detection: ImageDetection) -> LabelledCluster:
    return LabelledCluster(
        cluster.points, cluster.colors, cluster.plane, cluster.at_border, detection.label, detection.score
    )


def _part(cluster: Cluster, kept: NDArray[np.bool_]) -> Cluster:
    return Cluster(cluster.points[kept], cluster.colors[kept], cluster.plane, cluster.at_border)


def _overlap(box: tuple[float, float, float, float], pixels: NDArray[np.float64]) -> float:
    """Return the intersection over union of ``box`` and the box around the pixels (N, 2)."""
    lower, upper = np.nanmin(pixels, axis=0), np.nanmax(pixels, axis=0)
    common = np.minimum(upper, box[2:]) - np.maximum(lower, box[:2])
    if (common <= 0).any():
        return 0.0
    shared = float(np.prod(common))
    mine, yours = float(np.prod(upper - lower)), (box[2] - box[0]) * (box[3] - box[1])
    return shared / (mine + yours - shared)
