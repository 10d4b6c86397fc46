"""Detection of objects by markers attached to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import Box, ObjectModel, PlacedShape, Pose, RGBDImage
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.detection.base import DetectedScene, Detector, LabelledCluster
from bestman_bt.perception.detection.from_image import located
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.base import PoseEstimator
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.view import View

# Square markers: ArUco and AprilTag in images, and markers as coloured boxes for scenes.
# Garrido-Jurado et al., "Automatic Generation and Detection of Highly Reliable Fiducial Markers under Occlusion", 2014;
# Olson, "AprilTag: A Robust and Flexible Visual Fiducial System", 2011; detected by OpenCV.


WHITE, BLACK = (0.98, 0.98, 0.98), (0.03, 0.03, 0.03)


@dataclass(frozen=True, eq=False)
class MarkerDetection:
    """A detected marker. ``corners``: (4, 2) pixels (u, v), clockwise as printed, from its upper left corner."""

    id: int
    corners: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen_array(self.corners, (4, 2), "MarkerDetection corners"))


@dataclass(frozen=True)
class MarkerDetector:
    """Finds the markers of one dictionary. Raises PerceptionError for a dictionary unknown to OpenCV.

    ``dictionary``: OpenCV's name, such as DICT_4X4_50 or DICT_APRILTAG_36h11. ``min_perimeter``: of a marker, as a
    fraction of the image's longer side. ``max_corrected``: fraction of the dictionary's error correction that is used.
    """

    dictionary: str = "DICT_4X4_50"
    min_perimeter: float = 0.02
    max_corrected: float = 0.6

    def __post_init__(self) -> None:
        marker_dictionary(self.dictionary)

    def find(self, image: RGBDImage) -> tuple[MarkerDetection, ...]:
        """Return all markers in the colour image, by id, then by place."""
        if min(image.rgb.shape[:2]) < 8:
            return ()
        settings = cv2.aruco.DetectorParameters()
        settings.minMarkerPerimeterRate = self.min_perimeter
        settings.errorCorrectionRate = self.max_corrected
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        grey = cv2.cvtColor(image.rgb, cv2.COLOR_RGB2GRAY)
        corners, ids, _ = cv2.aruco.ArucoDetector(marker_dictionary(self.dictionary), settings).detectMarkers(grey)
        if ids is None:
            return ()
        numbers = np.asarray(ids).ravel()
        found = [
            MarkerDetection(int(n), np.asarray(quad, dtype=np.float64).reshape(4, 2))
            for n, quad in zip(numbers, corners, strict=True)
        ]
        return tuple(sorted(found, key=lambda marker: (marker.id, *marker.corners.mean(axis=0))))


def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of that name. Raises PerceptionError listing the names."""
    known = sorted(entry for entry in dir(cv2.aruco) if entry.startswith("DICT_"))
    wanted = {entry.upper(): entry for entry in known}.get(name.upper())
    if wanted is None:
        raise PerceptionError(f"no marker dictionary {name!r}; known: {', '.join(known)}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, wanted))


def marker_shapes(
    marker: int, size: float, dictionary: str = "DICT_4X4_50", thickness: float = 0.001
) -> tuple[tuple[PlacedShape, tuple[float, float, float]], ...]:
    """Return a marker as flat boxes with their colours, for renderers without textures.

    ``size``: edge of the black square, metres; a white border of one cell is added on each side. The frame is in the
    middle of the printed face: x to the printed right, y to the printed top, z out of it; all boxes are behind z = 0.
    Raises PerceptionError if the dictionary does not contain the marker.
    """
    words = marker_dictionary(dictionary)
    if not 0 <= marker < len(words.bytesList):
        raise PerceptionError(f"{dictionary} has markers 0 to {len(words.bytesList) - 1}, not {marker}")
    cells = words.markerSize + 2
    printed = np.pad(cv2.aruco.generateImageMarker(words, marker, cells) > 0, 1, constant_values=True)
    edge = size / cells
    half = edge * len(printed) / 2
    parts = []
    for row, line in enumerate(printed):
        ends = np.flatnonzero(np.diff(line)) + 1
        for start, stop in zip([0, *ends], [*ends, len(line)], strict=True):
            centre = ((start + stop) / 2 * edge - half, half - (row + 0.5) * edge, -thickness / 2)
            box = Box(((stop - start) * edge, edge, thickness))
            color = WHITE if line[start] else BLACK
            parts.append((PlacedShape(box, Pose(np.array(centre, dtype=float))), color))
    return tuple(parts)


@dataclass(frozen=True)
class ByMarker(MarkerDetector, Detector):
    """Labels each cluster by the marker visible on it; the pose comes from the object's model.

    Markers without a cluster, for example on the table itself, are ignored.

    ``markers``: marker id → object name. ``min_points``: minimum points of a cluster inside the marker.
    ``min_confidence``: minimum confidence of a pose, below which an object only gets its label.
    """

    markers: Mapping[int, str] = field(default_factory=dict)
    min_points: int = 5
    min_confidence: float = 0.5
    segmentation: Segmentation = field(default_factory=RegionGrowing)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)

    @override
    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
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
    """Return how many points of the cluster the camera sees inside of the marker's square."""
    pixels, _ = view.project(cluster.points)
    quad = cv2.convexHull(marker.corners.astype(np.float32))[:, 0]
    edges = np.roll(quad, -1, axis=0) - quad
    offsets = pixels[:, None] - quad[None]
    sides = edges[None, :, 0] * offsets[:, :, 1] - edges[None, :, 1] * offsets[:, :, 0]
    return int(((sides >= 0).all(axis=1) | (sides <= 0).all(axis=1)).sum())
