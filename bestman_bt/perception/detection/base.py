"""Detection: known objects in view, and unknown ones."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.segmentation.base import Cluster, Region, SegmentedScene, SupportPlane
from bestman_bt.perception.view import View


class Prepared:
    """Base of algorithms that load models or connect to a server before use; the default does nothing."""

    def prepare(self) -> None:
        """Load models or connect, before anything moves. Raises PerceptionError with the reason if that fails."""


@dataclass(frozen=True, eq=False)
class Detection:
    """A detected object of a known model. ``hypothesis``: the best pose; ``alternatives``: other models at the same
    place, best first.
    """

    cluster: Cluster
    hypothesis: PoseHypothesis
    alternatives: tuple[PoseHypothesis, ...] = ()

    @property
    def name(self) -> str:
        """The model's name."""
        return self.hypothesis.model.name

    @property
    def pose(self) -> Pose:
        """The pose of the object, frame_from_object."""
        return self.hypothesis.pose

    @property
    def confidence(self) -> float:
        """The confidence of the best hypothesis, 0 to 1; see ``PoseHypothesis``."""
        return self.hypothesis.confidence

    @property
    def score(self) -> float | None:
        """The detector's score, 0 to 1; None if the detector does not give one."""
        return self.cluster.score if isinstance(self.cluster, LabelledCluster) else None

    @property
    def at_border(self) -> bool:
        """Return whether the image border may cut off the object."""
        return self.cluster.at_border


@dataclass(frozen=True, eq=False)
class LabelledCluster(Cluster):
    """A cluster that a detector has labelled; in ``DetectedScene.unknown`` its pose is unknown, because no model exists
    or fits.

    ``score``: the detector's, 0 to 1.
    """

    label: str = ""
    score: float = 0.0


@dataclass(frozen=True, eq=False)
class DetectedScene:
    """The result of a detection. ``detections``: known objects, most confident first. ``unknown``: clusters that no
    model explains; they are obstacles.

    Unknown clusters with a label from an image detector are LabelledClusters. ``scene``: the segmentation.
    """

    scene: SegmentedScene
    detections: tuple[Detection, ...]
    unknown: tuple[Cluster, ...]

    @property
    def plane(self) -> SupportPlane:
        """The measured surface."""
        return self.scene.planes[0]

    def find(self, name: str) -> Detection | None:
        """Return the most confident detection of the object called ``name``, or None if it is not in view."""
        return next((detection for detection in self.detections if detection.name == name), None)

    def labelled(self, label: str) -> LabelledCluster | None:
        """Return the labelled cluster called ``label`` without a pose that has the highest score, or None."""
        named = [thing for thing in self.unknown if isinstance(thing, LabelledCluster) and thing.label == label]
        return max(named, key=lambda thing: thing.score, default=None)

    def obstacles_beside(self, name: str | None) -> tuple[Cluster, ...]:
        """Return all clusters except that of the object ``name``."""
        found = self.find(name) if name is not None else None
        others = tuple(detection.cluster for detection in self.detections if detection is not found)
        return others + self.unknown


class Detector(Prepared, ABC):
    """Finds known objects on a surface."""

    @abstractmethod
    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        """Detect ``models`` in the part of ``view`` that shows ``region``; objects that are not visible are omitted.

        Raises NoSurfaceError, with the reason, if no surface is seen.
        """


@dataclass(frozen=True)
class Naming:
    """Names clusters by their hypotheses. ``min_confidence``: below it a cluster is unknown.

    ``absorb_share``: a cluster belongs to a detected object if this fraction of its points lies in the object's
    bounding box, grown by ``absorb_margin`` metres (a cup may be split into its near and far walls).
    """

    min_confidence: float = 0.5
    absorb_share: float = 0.8
    absorb_margin: Annotated[float, "m"] = 0.01

    def named_scene(
        self, scene: SegmentedScene, found: Sequence[tuple[Cluster, tuple[PoseHypothesis, ...]]]
    ) -> DetectedScene:
        """Name each cluster by its first hypothesis if its confidence suffices; clusters are sorted by confidence."""
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
