"""Detection by colour and shape: cheap looks first, registration only for what a cluster could be.

Each cluster is compared with what every model would look like from the camera (see color_palette and shape_signature).
The likeliest models go to the pose estimator, the others not: so many models cost little. The estimator has the last
word: what it does not confirm has no name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from bestman_bt.messages import ObjectModel
from bestman_bt.perception.detection.base import DetectedScene, Detector
from bestman_bt.perception.detection.color_palette import palette_distance
from bestman_bt.perception.detection.naming import Naming
from bestman_bt.perception.detection.shape_signature import ModelLook, model_look, signature
from bestman_bt.perception.pose_estimation import MultiStart, PoseEstimator, PoseHypothesis
from bestman_bt.perception.segmentation import Cluster, Region, RegionGrowing, Segmentation
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class ColorShape(Naming, Detector):
    """Looks for colour and shape first, and registers only the models that a cluster could be.

    ``max_color``, ``max_shape``: distances of colours (see palette_distance) and shapes (see ModelLook) beyond which
    a model is not tried. ``color_weight``: of colour against shape in the order in which models are tried.
    ``first``: models that are tried at once, where they are within ``margin`` of the likeliest; the others, up to
    ``most``, are tried one after the other until one is confirmed.
    ``tie``: two confirmed models whose logits of confidence differ by less are told apart by colour and shape.
    ``elevation_step``: radians; looks of models are kept for such steps.
    """

    segmentation: Segmentation = field(default_factory=RegionGrowing)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)
    max_color: float = 0.15
    max_shape: float = 3.0
    color_weight: float = 15.0
    first: int = 2
    margin: float = 0.6
    most: int = 4
    tie: float = 1.5
    elevation_step: Annotated[float, "rad"] = math.radians(10.0)
    _looks: dict[tuple[ObjectModel, int], ModelLook] = field(default_factory=dict, init=False, repr=False)

    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        """See Detector."""
        scene = self.segmentation.segment(view, region, rng)
        found = [(cluster, self._hypotheses(cluster, models, view)) for cluster in scene.clusters]
        return self.named_scene(scene, found)

    def candidates(
        self, cluster: Cluster, models: Sequence[ObjectModel], view: View
    ) -> tuple[tuple[ObjectModel, float], ...]:
        """The models that ``cluster`` could be, likeliest first, each with its distance in colour and shape."""
        plane_from_frame = cluster.plane.frame_from_plane.inverse()
        points, eye = plane_from_frame.apply(cluster.points), plane_from_frame.apply(view.viewpoint)
        towards = eye - points.mean(axis=0)
        elevation = math.atan2(towards[2], math.hypot(towards[0], towards[1]))
        seen = signature(points, eye)
        found = []
        for model in models:
            look = self._look(model, round(elevation / self.elevation_step))
            color = palette_distance(cluster.colors, look.palette, look.shares)
            if color > self.max_color:
                continue
            shape = look.shape_distance(seen)
            if shape <= self.max_shape:
                found.append((model, shape + self.color_weight * color))
        found.sort(key=lambda item: item[1])
        return tuple(found)

    def _hypotheses(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        likely = self.candidates(cluster, models, view)[: self.most]
        distance = {model.name: value for model, value in likely}
        found: list[PoseHypothesis] = []
        close = [item for item in likely[: self.first] if item[1] <= likely[0][1] + self.margin]
        for some in (close, *([item] for item in likely[len(close) :])):
            found += self.pose_estimator.estimate(cluster, [model for model, _ in some], view)
            if any(hypothesis.confidence >= self.min_confidence for hypothesis in found):
                break
        found.sort(key=lambda hypothesis: -hypothesis.confidence)
        if len(found) > 1:
            level = _logit(found[0].confidence) - self.tie
            tied = [hypothesis for hypothesis in found if _logit(hypothesis.confidence) >= level]
            tied.sort(key=lambda hypothesis: distance[hypothesis.model.name])
            found = tied + [hypothesis for hypothesis in found if hypothesis not in tied]
        return tuple(found)

    def _look(self, model: ObjectModel, step: int) -> ModelLook:
        if (model, step) not in self._looks:
            self._looks[model, step] = model_look(model, step * self.elevation_step)
        return self._looks[model, step]


def _logit(confidence: float) -> float:
    bounded = min(max(confidence, 1e-9), 1.0 - 1e-9)
    return math.log(bounded / (1.0 - bounded))
