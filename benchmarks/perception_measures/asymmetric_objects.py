"""Mugs and ducks: does the ambiguity set of one view hold the true yaw, and does the planned second look resolve it?

The first look is from the mast, at an asymmetric object among others. The second is the one that the view planner ranks
first, from a camera beside the hand, on the robot's side of the table; its pose is known with the error of an arm and a
calibration. An object that is not found in the first look counts as not held by its set.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.crowded_table import crowded_table
from benchmarks.perception_measures.known_objects import shipped_models, wilson
from benchmarks.rendered_table import RenderedTable, TrueObject, render_table
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.messages.pose import wrap_angle
from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.base import AMBIGUOUS_YAW, PoseHypothesis
from bestman_bt.perception.pose_estimation.model_surface import model_surface
from bestman_bt.perception.pose_estimation.multi_view import MultiView, ViewObservation
from bestman_bt.perception.pose_estimation.point_to_plane import YawObservability, yaw_observability
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.view import View
from bestman_bt.perception.view_planning import ExpectedYaw, RankedView

CAMERA_POSITION_STD, CAMERA_ANGLE_STD = 0.001, math.radians(0.15)
TELLING = 0.008
"""Metres: surface that moves by more when the object turns is the telling feature: the handle, head and tail."""
IN_VIEW = 0.5
"""The feature is in view where this share of what its best side would show was measured."""


@dataclass
class Look:
    """Degrees; ``second_error``: of the fused yaw, None where no second look was had. ``feature``: share in view."""

    name: str
    held: bool
    width: float
    error: float
    feature: float
    second_error: float | None = None
    second_held: bool | None = None
    second_width: float | None = None
    promised: float | None = None
    planning_ms: float | None = None

    @property
    def ambiguous(self) -> bool:
        """Whether the skill would take a second look."""
        return self.width > math.degrees(AMBIGUOUS_YAW)


def measure(seed: int, objects: int = 80, detector: Detector | None = None) -> dict[str, object]:
    """One object each in the frames ``seed``, ``seed`` + 1, …."""
    models = shipped_models()
    asymmetric = [model for model in models if model.symmetry_order == 1]
    bench = _Bench(detector or ColorShape(), models)
    looks = []
    for frame in range(seed, seed + objects):
        model = asymmetric[frame % len(asymmetric)]
        scene = crowded_table(frame, models, (2, 5), always=(model,))
        if scene.objects and scene.objects[0].model is model:
            looks.append(bench.look(scene, np.random.default_rng(frame)))
    return report(looks)


def report(looks: list[Look]) -> dict[str, object]:
    """The figures, flat; degrees and milliseconds."""
    found = [look for look in looks if math.isfinite(look.error)]
    clear = [look for look in found if look.feature >= IN_VIEW]
    again = [look for look in found if look.second_error is not None]
    needed = [look for look in again if look.ambiguous]

    def p90(group: list[Look]) -> float:
        return _rounded(np.percentile([look.second_error for look in group], 90)) if group else math.nan

    return {
        "asymmetric_objects": len(looks),
        "not_found": len(looks) - len(found),
        "ambiguity_coverage": _mean([look.held for look in looks]),
        "ambiguity_coverage_interval": wilson(sum(look.held for look in looks), len(looks)),
        "ambiguity_width_deg_mean": _mean([look.width for look in found]),
        "ambiguity_width_deg_by_name": {
            name: _mean([look.width for look in found if look.name == name])
            for name in sorted({look.name for look in found})
        },
        "feature_in_view": len(clear),
        "ambiguity_width_deg_feature_in_view": _mean([look.width for look in clear]),
        "ambiguous": sum(look.ambiguous for look in found),
        "yaw_p90_deg_first_look": _rounded(np.percentile([look.error for look in found], 90)) if found else math.nan,
        "second_looks_needed": len(needed),
        "yaw_p90_deg_second_look": p90(needed),
        "yaw_p90_deg_second_look_all": p90(again),
        "yaw_max_deg_second_look": max((_rounded(look.second_error or 0.0) for look in again), default=math.nan),
        "second_look_coverage": _mean([bool(look.second_held) for look in again]),
        "second_look_width_deg_mean": _mean([look.second_width or 0.0 for look in again]),
        "second_look_width_deg_promised": _mean([look.promised or 0.0 for look in again]),
        "planning_ms": _rounded(np.median([look.planning_ms or 0.0 for look in again])) if again else math.nan,
    }


class _Bench:
    """First and second look at one object."""

    def __init__(self, detector: Detector, models: tuple[ObjectModel, ...]) -> None:
        self.detector, self.models = detector, models
        self.planner, self.fusion, self.segmentation = ExpectedYaw(), MultiView(), PlaneDbscan()
        self._turned: dict[ObjectModel, YawObservability] = {}

    def look(self, scene: RenderedTable, rng: np.random.Generator) -> Look:
        """Both looks at the first object of the scene."""
        item = scene.objects[0]
        found = self.detector.detect(scene.view, scene.region, self.models, rng)
        feature = self.feature_in_view(scene.view, item)
        detection = found.find(item.model.name)
        if detection is None:
            return Look(item.model.name, False, math.nan, math.nan, feature)
        first = detection.hypothesis
        look = Look(item.model.name, *_judged(first, item), feature)
        start = time.process_time()
        planned = self.plan(scene, found, detection)
        look.planning_ms = (time.process_time() - start) * 1e3
        second = self._second_view(scene, planned.frame_from_camera, rng)
        cluster = self._same_thing(second, scene, first, rng)
        if cluster is not None:
            both = [ViewObservation(detection.cluster, scene.view), ViewObservation(cluster, second)]
            fused = self.fusion.estimate(both, [item.model])
            if fused:
                look.second_held, look.second_width, look.second_error = _judged(fused[0], item)
                look.promised = math.degrees(planned.expected_yaw_width)
        return look

    def plan(self, scene: RenderedTable, found: DetectedScene, detection: Detection) -> RankedView:
        """The best candidate that is not beyond the table: a wall may be there."""
        intrinsics = scene.view.image.intrinsics
        candidates = self.planner.candidates(detection.hypothesis, intrinsics)
        near = [c for c in candidates if scene.table.inverse().apply(c.position)[0] < scene.size[0] / 2 - 0.05]
        obstacles = [cluster.obstacle() for cluster in found.obstacles_beside(detection.name)]
        return self.planner.rank(detection.hypothesis, near, intrinsics, obstacles)[0]

    def feature_in_view(self, view: View, item: TrueObject) -> float:
        """Measured samples of the telling feature, as a share of those that its best side would show."""
        turned = self._turned.get(item.model) or yaw_observability(model_surface(item.model, Pose(), 0.003))
        self._turned[item.model] = turned
        surface, telling = turned.surface, turned.largest_distances > TELLING
        frame_from_rest = item.pose @ surface.rest_from_object.inverse()
        points, normals = surface.points[telling], surface.normals[telling]
        most = 0
        for angle in np.arange(24) * math.pi / 12:
            placed = frame_from_rest @ Pose.from_xyz_rpy((0, 0, 0), (0, 0, angle))
            most = max(most, int(_facing(placed, points, normals, view).sum()))
        facing = _facing(frame_from_rest, points, normals, view)
        pixels, depth = view.project(frame_from_rest.apply(points[facing]))
        measured = view.measured_depth(pixels)
        # Drop-outs at edges are no occlusion.
        seen = ~(measured < depth - 0.010)
        return float(seen.sum() / max(1, most))

    def _second_view(self, scene: RenderedTable, frame_from_camera: Pose, rng: np.random.Generator) -> View:
        error = Pose.from_xyz_rpy(rng.normal(0.0, CAMERA_POSITION_STD, 3), rng.normal(0.0, CAMERA_ANGLE_STD, 3))
        wall = float(scene.table.position[2]) > 0.8
        true = render_table(scene.objects, scene.table, scene.size, rng, wall, None, frame_from_camera @ error)
        return View(true.view.image, frame_from_camera)

    def _same_thing(
        self, view: View, scene: RenderedTable, hypothesis: PoseHypothesis, rng: np.random.Generator
    ) -> Cluster | None:
        try:
            clusters = self.segmentation.segment(view, scene.region, rng).clusters
        except PerceptionError:
            return None
        lower, upper = hypothesis.model.bounds()
        middle = hypothesis.pose.apply((lower + upper) / 2)
        distances = [float(np.linalg.norm((c.points.mean(axis=0) - middle)[:2])) for c in clusters]
        nearest = int(np.argmin(distances)) if distances else 0
        return clusters[nearest] if distances and distances[nearest] < 0.06 else None


def _judged(hypothesis: PoseHypothesis, item: TrueObject) -> tuple[bool, float, float]:
    """Whether the set holds the truth, its width and the error of the likeliest, degrees."""
    error = abs(wrap_angle(hypothesis.pose.yaw - item.pose.yaw))
    held = hypothesis.yaw_set.contains(item.pose.yaw)
    return held, math.degrees(hypothesis.yaw_set.width), math.degrees(error)


def _facing(
    frame_from_rest: Pose, points: NDArray[np.float64], normals: NDArray[np.float64], view: View
) -> NDArray[np.bool_]:
    towards = view.viewpoint - frame_from_rest.apply(points)
    cosine = (towards * (normals @ frame_from_rest.rotation.T)).sum(axis=1)
    facing: NDArray[np.bool_] = cosine > 0.15 * np.linalg.norm(towards, axis=1)
    return facing


def _mean(values: list[bool] | list[float]) -> float:
    return _rounded(np.mean(values)) if values else math.nan


def _rounded(value: float | np.floating) -> float:
    return round(float(value), 3)
