"""Known objects on crowded tables: are they named rightly, and how well placed?

A known object counts as wrong where it is missed, split into several detections, or named otherwise. Intervals: Wilson,
95 %. Times: processor time of detection with one BLAS thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.crowded_table import crowded_table, hidden_shares
from benchmarks.rendered_table import RenderedTable, TrueObject, known_models
from bestman_bt.configuration.data import data_names
from bestman_bt.evaluation.interval import wilson_interval
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.pose_estimation.model_surface import model_surface
from bestman_bt.scene.object_file import read_object

LARGEST = 0.25
"""Metres: shipped objects that are longer stand on no crowded table."""


def measure(seed: int, frames: int = 60, detector: Detector | None = None) -> dict[str, object]:
    """Frames ``seed``, ``seed`` + 1, …: by turns the shipped objects and cups, cans and boxes of changing colours."""
    detector = detector or ColorShape()
    shipped = shipped_models()
    tally = Tally()
    repeated = True
    for frame in range(seed, seed + frames):
        models = shipped if frame % 2 == 0 else known_models(frame // 2)
        scene = crowded_table(frame, models)
        if frame == seed:
            # The surfaces of the models are sampled once.
            detector.detect(scene.view, scene.region, models, np.random.default_rng(frame))
        start = time.process_time()
        found = detector.detect(scene.view, scene.region, models, np.random.default_rng(frame))
        tally.milliseconds.append((time.process_time() - start) * 1e3)
        tally.add(scene, found)
        if frame < seed + 3:
            again = detector.detect(scene.view, scene.region, models, np.random.default_rng(frame))
            repeated = repeated and _equal(found, again)
    return {"frames": frames, "models_shipped": [m.name for m in shipped], **tally.report(), "repeatable": repeated}


def shipped_models() -> tuple[ObjectModel, ...]:
    """The objects of assets/objects that fit on a table together."""
    models = (read_object(name) for name in data_names("object"))
    return tuple(model for model in models if float(model.size.max()) <= LARGEST)


class Tally:
    """What the frames have shown so far."""

    def __init__(self) -> None:
        self.known = self.right = self.ambiguous = 0
        self.hidden = self.hidden_right = 0
        self.sure_of_right = self.sure_of_wrong = self.wrong_models = 0
        self.by_name: dict[str, list[int]] = {}
        self.confusions: dict[str, int] = {}
        self.position: list[float] = []
        self.normalised: list[float] = []
        self.yaw: list[float] = []
        self.yaw_normalised: list[float] = []
        self.add_s: list[float] = []
        self.milliseconds: list[float] = []
        self._surfaces: dict[ObjectModel, NDArray[np.float64]] = {}

    def add(self, scene: RenderedTable, found: DetectedScene) -> None:
        """Compare one frame with the truth."""
        hidden = hidden_shares(scene.objects, scene.view.frame_from_camera)
        for item, share in zip(scene.objects, hidden, strict=True):
            near = [detection for detection in found.detections if shares_place(detection, item)]
            self.known += 1
            right = len(near) == 1 and near[0].name == item.model.name
            self.right += right
            hits = self.by_name.setdefault(item.model.name, [0, 0])
            hits[0] += right
            hits[1] += 1
            self.hidden_right += right and share > 0.1
            self.hidden += share > 0.1
            if right:
                self._measure(near[0], item)
            else:
                what = "+".join(sorted(detection.name for detection in near)) or "nothing"
                key = f"{item.model.name} as {what}"
                self.confusions[key] = self.confusions.get(key, 0) + 1

    def _measure(self, detection: Detection, item: TrueObject) -> None:
        hypothesis = detection.hypothesis
        self.sure_of_right += hypothesis.confidence > 0.8
        for other in detection.alternatives:
            self.wrong_models += 1
            self.sure_of_wrong += other.confidence > 0.5
        error = (detection.pose.position - item.pose.position)[:2]
        turn = symmetric_difference(detection.pose.yaw - item.pose.yaw, item.model.symmetry_order)
        # The covariance is about the likeliest yaw: it says nothing where others are open.
        self.ambiguous += hypothesis.ambiguous_yaw
        if not hypothesis.ambiguous_yaw:
            self.position.append(float(np.linalg.norm(error)) * 1e3)
            self.normalised.append(float(error @ np.linalg.solve(hypothesis.covariance[:2, :2], error)))
        if item.model.symmetry_order and not hypothesis.ambiguous_yaw:
            self.yaw.append(math.degrees(turn))
            self.yaw_normalised.append((turn / hypothesis.yaw_std) ** 2)
        points = self._surface(item.model)
        placed = cKDTree(detection.pose.apply(points))
        self.add_s.append(float(placed.query(item.pose.apply(points))[0].mean()) * 1e3)

    def _surface(self, model: ObjectModel) -> NDArray[np.float64]:
        if model not in self._surfaces:
            surface = model_surface(model, Pose(), 0.0015)
            self._surfaces[model] = surface.rest_from_object.inverse().apply(surface.points)
        return self._surfaces[model]

    def report(self) -> dict[str, object]:
        """The figures, flat. ``…chi_square…``: squared errors over their variances; of honest ones 95 % lie below
        5.99 in two dimensions and 3.84 in one. Position and yaw: of objects whose yaw the view does not leave open.
        """
        return {
            "known_objects": self.known,
            "identity_rate": self.right / max(1, self.known),
            "identity_interval": wilson(self.right, self.known),
            "identity_hidden_over_10_percent": f"{self.hidden_right}/{self.hidden}",
            "identity_by_name": {name: f"{hits}/{tries}" for name, (hits, tries) in sorted(self.by_name.items())},
            "confusions": self.confusions,
            "right_with_confidence_above_0.8": self.sure_of_right / max(1, self.right),
            "wrong_models_tried": self.wrong_models,
            "wrong_models_with_confidence_above_0.5": self.sure_of_wrong / max(1, self.wrong_models),
            "ambiguous_yaw": self.ambiguous,
            "position_mm": quantiles(self.position),
            "position_chi_square_within_5.99": share_below(self.normalised, 5.99),
            "yaw_deg": quantiles(self.yaw),
            "yaw_chi_square_within_3.84": share_below(self.yaw_normalised, 3.84),
            "add_s_median_mm": percentile(self.add_s, 50),
            "add_s_p90_mm": percentile(self.add_s, 90),
            "add_s_mm": quantiles(self.add_s),
            "ms_per_frame": percentile(self.milliseconds, 50),
            "ms_per_frame_p90": percentile(self.milliseconds, 90),
        }


def wilson(hits: int, tries: int) -> list[float]:
    """The 95 % interval of a rate."""
    return [round(bound, 4) for bound in wilson_interval(hits, tries)]


def quantiles(values: Sequence[float]) -> dict[str, object]:
    """Median with its 95 % bootstrap interval, 90 % quantile, maximum."""
    if not values:
        return {}
    array: NDArray[np.float64] = np.array(values)
    resampled = array[np.random.default_rng(0).integers(len(array), size=(1000, len(array)))]
    low, high = np.percentile(np.median(resampled, axis=1), [2.5, 97.5])
    return {
        "median": round(float(np.median(array)), 3),
        "median_interval": [round(float(low), 3), round(float(high), 3)],
        "p90": round(float(np.percentile(array, 90)), 3),
        "max": round(float(array.max()), 3),
    }


def percentile(values: Sequence[float], percent: float) -> float:
    """Of all values; NaN of none."""
    return round(float(np.percentile(values, percent)), 3) if values else math.nan


def share_below(values: Sequence[float], limit: float) -> float:
    """Of all values."""
    return round(float(np.mean(np.array(values) < limit)), 4) if values else math.nan


def symmetric_difference(angle: float, order: int) -> float:
    """Size of an angle modulo the symmetry, radians."""
    if order == 0:
        return 0.0
    span = 2 * math.pi / order
    return abs((angle + span / 2) % span - span / 2)


def shares_place(detection: Detection, item: TrueObject) -> bool:
    """Whether a detection speaks of that object: most of its points lie in the object's bounding box."""
    local = item.pose.inverse().apply(detection.cluster.points)
    lower, upper = item.model.bounds()
    return bool(((local > lower - 0.01) & (local < upper + 0.01)).all(axis=1).mean() > 0.5)


def _equal(one: DetectedScene, other: DetectedScene) -> bool:
    return len(one.detections) == len(other.detections) and all(
        a.name == b.name and a.confidence == b.confidence and np.array_equal(a.pose.matrix, b.pose.matrix)
        for a, b in zip(one.detections, other.detections, strict=True)
    )
