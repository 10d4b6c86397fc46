"""Perception on rendered tables with known truth: identity, pose error, calibration of the confidence, time.

    python benchmarks/perception.py [--seed S] [--frames N] [--lookalikes] [--shipped] [--json]

Frames S, S+1, … show 3 known objects out of 5 (or the shipped ones) and 2 unknown things; a missed, split or wrongly
named known object counts as wrong. Intervals: Wilson, 95 %. Times: processor time of one frame, one BLAS thread.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import math
import os
import platform
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, random_table
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.detection import DetectedScene, Detection, ModelRegistration
from bestman_bt.perception.pose_estimation.model_surface import model_surface
from bestman_bt.perception.segmentation import surface_coverage
from bestman_bt.scene import read_object

SHIPPED = ("cup", "can", "box")


class Tally:
    """What the frames have shown so far."""

    def __init__(self) -> None:
        self.known = self.right = self.unknown = self.unknown_named = 0
        self.sure_of_right = self.sure_of_wrong = self.wrong_models = 0
        self.confusions: dict[str, int] = {}
        self.position: list[float] = []
        self.normalised: list[float] = []
        self.yaw: list[float] = []
        self.add_s: list[float] = []
        self.milliseconds: list[float] = []
        self.coverage_milliseconds: list[float] = []
        self.height: list[float] = []

    def add(self, scene: RenderedTable, found: DetectedScene) -> None:
        """Compare one frame with the truth."""
        x, y, z = scene.table.position
        self.height.append(abs(found.plane.height_at(x, y) - z) * 1e3)
        for item in scene.objects:
            near = [d for d in found.detections if _shares_place(d, item)]
            if not item.known:
                self.unknown += 1
                self.unknown_named += bool(near)
                self._confuse(item, near)
                continue
            self.known += 1
            right = len(near) == 1 and near[0].name == item.model.name
            self.right += right
            if right:
                self._measure(near[0], item)
            else:
                self._confuse(item, near)

    def _confuse(self, item: TrueObject, near: list[Detection]) -> None:
        true = item.model.name if item.known else "unknown"
        for name in sorted({d.name for d in near}) or (["missed"] if item.known else []):
            self.confusions[f"{true} as {name}"] = self.confusions.get(f"{true} as {name}", 0) + 1

    def _measure(self, detection: Detection, item: TrueObject) -> None:
        hypothesis = detection.hypothesis
        self.sure_of_right += hypothesis.confidence > 0.8
        for other in detection.alternatives:
            self.wrong_models += 1
            self.sure_of_wrong += other.confidence > 0.5
        error = float(np.linalg.norm((detection.pose.position - item.pose.position)[:2]))
        self.position.append(error * 1e3)
        self.normalised.append(error / hypothesis.position_std)
        order = item.model.symmetry_order
        if order:
            span = 2 * math.pi / order
            turn = detection.pose.yaw - item.pose.yaw
            self.yaw.append(math.degrees(abs((turn + span / 2) % span - span / 2)))
        surface = model_surface(item.model, Pose(), 0.0015)
        points = surface.rest_from_object.inverse().apply(surface.points)
        placed = cKDTree(detection.pose.apply(points))
        self.add_s.append(float(placed.query(item.pose.apply(points))[0].mean()) * 1e3)

    def report(self) -> dict[str, object]:
        """The figures, flat."""
        return {
            "known_objects": self.known,
            "identity_rate": self.right / max(1, self.known),
            "identity_interval": wilson(self.right, self.known),
            "unknown_objects": self.unknown,
            "unknown_named_rate": self.unknown_named / max(1, self.unknown),
            "unknown_named_interval": wilson(self.unknown_named, self.unknown),
            "confusions": self.confusions,
            "right_with_confidence_above_0.8": self.sure_of_right / max(1, self.right),
            "wrong_models_tried": self.wrong_models,
            "wrong_models_with_confidence_above_0.5": self.sure_of_wrong / max(1, self.wrong_models),
            "position_mm": quantiles(self.position),
            "position_error_over_std": quantiles(self.normalised),
            "yaw_deg": quantiles(self.yaw),
            "add_s_median_mm": float(np.median(self.add_s)),
            "add_s_p90_mm": float(np.percentile(self.add_s, 90)),
            "surface_height_mm": quantiles(self.height),
            "ms_per_frame": float(np.median(self.milliseconds)),
            "ms_per_frame_p90": float(np.percentile(self.milliseconds, 90)),
            "ms_surface_coverage": float(np.median(self.coverage_milliseconds)),
        }


def wilson(hits: int, tries: int, z: float = 1.96) -> list[float]:
    """The 95 % interval of a rate."""
    if tries == 0:
        return [0.0, 1.0]
    rate, spread = hits / tries, z * z / tries
    centre = (rate + spread / 2) / (1 + spread)
    half = z * math.sqrt(rate * (1 - rate) / tries + spread / (4 * tries)) / (1 + spread)
    return [round(centre - half, 4), round(centre + half, 4)]


def quantiles(values: list[float]) -> dict[str, object]:
    """Median with its 95 % bootstrap interval, 90 % quantile, maximum."""
    array: NDArray[np.float64] = np.array(values)
    resampled = array[np.random.default_rng(0).integers(len(array), size=(1000, len(array)))]
    low, high = np.percentile(np.median(resampled, axis=1), [2.5, 97.5])
    return {
        "median": round(float(np.median(array)), 3),
        "median_interval": [round(float(low), 3), round(float(high), 3)],
        "p90": round(float(np.percentile(array, 90)), 3),
        "max": round(float(array.max()), 3),
    }


def _shares_place(detection: Detection, item: TrueObject) -> bool:
    local = item.pose.inverse().apply(detection.cluster.points)
    return bool((np.abs(local) < item.model.size / 2 + 0.01).all(axis=1).mean() > 0.5)


def run(seed: int, frames: int, lookalikes: bool, shipped: bool) -> dict[str, object]:
    """Look at ``frames`` scenes, the first drawn from ``seed``."""
    detector, tally = ModelRegistration(), Tally()
    own: tuple[ObjectModel, ...] | None = tuple(read_object(name) for name in SHIPPED) if shipped else None
    for frame in range(seed, seed + frames):
        palette = frame % 4
        models = own or known_models(palette)
        scene = random_table(frame, palette=palette, lookalikes=lookalikes, models=own)
        if frame == seed:
            detector.detect(scene.view, scene.region, models, np.random.default_rng(0))
        start = time.process_time()
        found = detector.detect(scene.view, scene.region, models, np.random.default_rng(frame))
        tally.milliseconds.append((time.process_time() - start) * 1e3)
        start = time.process_time()
        surface_coverage(scene.view, scene.region, found.scene)
        tally.coverage_milliseconds.append((time.process_time() - start) * 1e3)
        tally.add(scene, found)
    versions = {
        name: importlib.metadata.version(name) for name in ("numpy", "scipy", "opencv-python-headless", "pybullet")
    }
    return {
        "seed": seed,
        "frames": frames,
        "lookalikes": lookalikes,
        "models": "shipped" if shipped else "benchmark",
        **tally.report(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "versions": versions,
    }


def main() -> None:
    """Read the options, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=5000)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--lookalikes", action="store_true", help="unknown things have size and colour of known ones")
    parser.add_argument("--shipped", action="store_true", help="the objects in assets/objects")
    parser.add_argument("--json", action="store_true", help="one JSON document")
    options = parser.parse_args()
    result = run(options.seed, options.frames, options.lookalikes, options.shipped)
    if options.json:
        print(json.dumps(result))
        return
    for key, value in result.items():
        print(f"{key:40} {value}")


if __name__ == "__main__":
    main()
