"""Known objects grasped in physics: recognised and placed in one noisy image, taken by grasps of their models.

Alone on a table, and among two to five others that stand 3 to 8 cm apart.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from benchmarks.grasp_reach import HandReach
from benchmarks.grasp_rig import GraspRig
from benchmarks.grasp_scenes import GraspScene, draw_scene, standing
from benchmarks.perception_measures.grasp_episodes import TARGET, GraspEpisode, PlannedGrasp, run_episode
from benchmarks.perception_measures.grasp_figures import grasp_figures
from benchmarks.perception_measures.in_parallel import in_parallel
from bestman_bt.configuration.data import data_names
from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.detection.base import DetectedScene, Detection, Detector
from bestman_bt.perception.detection.from_image import ModelRegistration
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.grasp_pose.base import GraspPlanner, GraspTarget
from bestman_bt.perception.grasp_pose.model_based import ModelBased
from bestman_bt.perception.grasp_pose.ranking import GraspRanking
from bestman_bt.scene.object_file import read_object

GAP = (0.03, 0.08)
TOO_WIDE = ("crate",)
"""Shipped objects that no gripper of 8 cm can take."""


def measure(
    seed: int, single: int = 200, clutter: int = 100, jobs: int = 1, pictures: Path | None = None
) -> dict[str, object]:
    """Grasps drawn from ``seed``, ``seed`` + 1, …: ``single`` of lone objects, ``clutter`` of crowded ones."""
    alone, crowded = (
        in_parallel(
            partial(known_episode, crowded=crowded, pictures=pictures), range(seed, seed + count), jobs, f"known, {how}"
        )
        for crowded, count, how in ((False, single, "alone"), (True, clutter, "crowded"))
    )
    return grasp_figures(alone, "known_grasp") | grasp_figures(crowded, "known_grasp", "_clutter")


def known_episode(seed: int, crowded: bool, pictures: Path | None = None) -> GraspEpisode:
    """One grasp of one of the shipped objects."""
    rng = np.random.default_rng([seed, int(crowded), 7])
    models = graspable_models()
    count = int(rng.integers(3, 7)) if crowded else 1
    chosen = [models[index] for index in rng.permutation(len(models))[:count]]
    scene = draw_scene(seed, [(model, standing(model)) for model in chosen], GAP)
    plan = partial(plan_grasp, scene=scene, wanted=chosen[0].name)
    return run_episode(seed, scene, plan, pictures and pictures / ("crowded" if crowded else "alone"))


def plan_grasp(rig: GraspRig, scene: GraspScene, wanted: str) -> PlannedGrasp:
    """Look once, find the object called ``wanted``, and choose the best grasp of its model there."""
    view = rig.look()
    try:
        found = _detector().detect(view, scene.region, graspable_models(), np.random.default_rng(scene.world.seed))
    except PerceptionError as error:
        return PlannedGrasp(view, None, f"no surface: {error}")
    detection = found.find(wanted)
    if detection is None:
        return PlannedGrasp(view, None, "not recognised")
    notes = _errors(detection, rig.truth.object_pose(TARGET))
    target = replace(
        GraspTarget.of_model(detection.hypothesis.model, detection.pose), surroundings=_others(found, detection)
    )
    x, y, _ = detection.pose.position
    candidates = _planner().plan(target, rig.gripper, found.plane.height_at(x, y))
    things = [cluster.obstacle() for cluster in found.obstacles_beside(wanted)]
    ranked = GraspRanking().rank(candidates, HandReach(rig, found.plane.slab(0.02, 0.2), things))
    if not ranked:
        why = "none of the grasps can be reached" if candidates else "no grasp was found"
        return PlannedGrasp(view, None, why, notes)
    best = ranked[0].candidate
    notes["grasp"] = f"{best.approach}, quality {best.quality:.2f}, of {len(ranked)} and {len(candidates)}"
    return PlannedGrasp(view, best, notes=notes)


@cache
def graspable_models() -> tuple[ObjectModel, ...]:
    """The shipped objects that the hand can take."""
    return tuple(read_object(name) for name in data_names("object") if name not in TOO_WIDE)


@cache
def _detector() -> Detector:
    return ModelRegistration()


@cache
def _planner() -> GraspPlanner:
    return ModelBased()


def _others(found: DetectedScene, target: Detection) -> np.ndarray:
    clusters = [cluster.points for cluster in found.scene.clusters if cluster is not target.cluster]
    return np.concatenate([np.zeros((0, 3)), *clusters])


def _errors(detection: Detection, truth: Pose) -> dict[str, object]:
    """How far off the estimated pose is."""
    way = detection.pose.position - truth.position
    notes: dict[str, object] = {"pose_error_mm": [round(1e3 * float(v), 1) for v in way]}
    order = detection.hypothesis.model.symmetry_order
    if order:
        span = 2 * math.pi / order
        turn = (detection.pose.yaw - truth.yaw + span / 2) % span - span / 2
        notes["yaw_error_deg"] = round(math.degrees(turn), 1)
        notes["ambiguous_yaw"] = detection.hypothesis.ambiguous_yaw
    return notes
