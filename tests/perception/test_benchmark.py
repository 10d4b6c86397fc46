"""The assembled benchmark in small, and the rig that judges grasps."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import perception
from benchmarks.grasp_rig import GraspRig
from benchmarks.grasp_scenes import GraspScene, draw_scene, standing
from benchmarks.perception_measures.segmentation_truth import judged
from benchmarks.perception_measures.unknown_objects import draw_shapes, narrowest_width
from bestman_bt.messages import Pose
from bestman_bt.perception.grasp_pose.base import GraspCandidate, GraspTarget
from bestman_bt.perception.grasp_pose.model_based import ModelBased
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.scene.object_file import read_object

pytestmark = pytest.mark.slow

SCRIPT = Path(perception.__file__)


@pytest.fixture(scope="module")
def scene() -> GraspScene:
    can = read_object("can")
    return draw_scene(41, [(can, standing(can))], (0.03, 0.08))


def best_grasp(rig: GraspRig, scene: GraspScene) -> GraspCandidate:
    target = GraspTarget.of_model(read_object("can"), rig.truth.object_pose("thing_0"))
    return ModelBased().plan(target, rig.gripper, scene.table_height)[0]


def test_the_benchmark_prints_one_document_with_all_figures() -> None:
    options = ["--seed", "101", "--frames", "1", "--grasps", "1", "--only", "invented,grasps", "--json"]
    done = subprocess.run(
        [sys.executable, str(SCRIPT), *options], capture_output=True, text=True, check=True, env={**os.environ}
    )
    report = json.loads(done.stdout)
    assert set(perception.TARGETS) | {"seed", "frames", "machine", "versions"} <= set(report)
    assert report["known_grasp_rate"] == 1.0
    assert report["details"]["invented"]["invented_objects"] == 0
    assert report["handle_recall"] is None
    assert report["details"]["grasps"]["known_grasp_cheats"] == 0


@pytest.mark.parametrize("wrong", [["--only", "yaw"], ["--grasps", "0"], ["--frames", "many"], ["--fast"]])
def test_wrong_options_exit_with_code_2(wrong: list[str]) -> None:
    with pytest.raises(SystemExit) as left:
        perception.read_options(wrong)
    assert left.value.code == 2


def test_figures_that_json_cannot_say_become_null() -> None:
    assert perception.strict({"a": [float("nan"), 1.5], "b": float("inf")}) == {"a": [None, 1.5], "b": None}


def test_a_good_grasp_lifts_and_holds_without_cheating(scene: GraspScene) -> None:
    with GraspRig(scene.world, scene.table_height, scene.head) as rig:
        outcome = rig.grasp(best_grasp(rig, scene), "thing_0")
        audit = rig.audit()
    assert outcome.success
    assert outcome.height > 0.13
    assert outcome.contacts == ()
    assert set(audit.values()) == {0}


def test_without_friction_nothing_is_lifted(scene: GraspScene) -> None:
    slippery = replace(scene.world, finger_friction=0.0)
    with GraspRig(slippery, scene.table_height, scene.head) as rig:
        outcome = rig.grasp(best_grasp(rig, scene), "thing_0")
    assert not outcome.success


def test_a_grasp_beside_the_object_finds_nothing(scene: GraspScene) -> None:
    with GraspRig(scene.world, scene.table_height, scene.head) as rig:
        outcome = rig.grasp(moved(best_grasp(rig, scene), (0.0, 0.15, 0.0)), "thing_0")
    assert outcome.why == "nothing between the fingers"
    assert outcome.contacts == ()


def test_a_hand_that_is_driven_into_the_table_is_reported(scene: GraspScene) -> None:
    with GraspRig(scene.world, scene.table_height, scene.head) as rig:
        good = best_grasp(rig, scene)
        down = scene.table_height - 0.005 - float(good.grasp.position[2])
        outcome = rig.grasp(moved(good, (0.0, 0.15, down)), "thing_0")
    assert not outcome.success
    assert "table" in outcome.contacts


def moved(candidate: GraspCandidate, way: tuple[float, float, float]) -> GraspCandidate:
    shift = Pose(np.array(way))
    return replace(candidate, grasp=shift @ candidate.grasp, pre_grasp=shift @ candidate.pre_grasp)


def test_resetting_a_pose_is_counted_against_the_rig(scene: GraspScene) -> None:
    with GraspRig(scene.world, scene.table_height, scene.head) as rig:
        simulation = rig.simulation
        body = simulation.built.objects["thing_0"]
        simulation.engine.put(body, [0.6, 0.0, 1.2], [0.0, 0.0, 0.0, 1.0])
        assert rig.audit()["resets"] == 1


def test_split_merged_and_missed_things_are_told_from_right_ones() -> None:
    things = [read_object("can"), read_object("box")]
    scene = draw_scene(43, [(model, standing(model)) for model in things], (0.05, 0.08))
    with GraspRig(scene.world, scene.table_height, scene.head) as rig:
        view, masks = rig.look(), rig.masks()
    clusters = PlaneDbscan().segment(view, scene.region, np.random.default_rng(0)).clusters
    assert judged(clusters, masks, view) == {"thing_0": "", "thing_1": ""}
    assert set(judged(clusters[:1], masks, view).values()) == {"", "missed or merged"}
    merged = joined(*clusters)
    assert "" not in judged([merged], masks, view).values()
    first = clusters[0].points[:, 2] > np.median(clusters[0].points[:, 2])
    halves = [replace(clusters[0], points=clusters[0].points[h], colors=clusters[0].colors[h]) for h in (first, ~first)]
    assert set(judged([*halves, clusters[1]], masks, view).values()) == {"", "split"}


def joined(one: Cluster, other: Cluster) -> Cluster:
    points, colors = (np.concatenate([getattr(one, name), getattr(other, name)]) for name in ("points", "colors"))
    return replace(one, points=points, colors=colors)


def test_shapes_of_development_and_of_tests_have_none_in_common() -> None:
    mine, theirs = (draw_shapes(np.random.default_rng(0), 6, for_tests) for for_tests in (False, True))
    assert {int(model.name[-3:]) % 2 for model in mine} == {0}
    assert {int(model.name[-3:]) % 2 for model in theirs} == {1}
    assert max(narrowest_width(model) for model in mine + theirs) <= 0.070
