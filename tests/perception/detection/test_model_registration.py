from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, render_table
from bestman_bt.messages import Pose
from bestman_bt.perception.detection.base import DetectedScene
from bestman_bt.perception.detection.from_image import ModelRegistration
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.scene.object_file import read_object

Tables = Callable[..., RenderedTable]
MODELS = known_models(1)
DETECTOR = ModelRegistration()


def detect(scene: RenderedTable, models: tuple = MODELS) -> DetectedScene:
    return DETECTOR.detect(scene.view, scene.region, models, np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60, 64))
def test_every_known_object_is_found_by_its_name_and_nothing_else_is(table: Tables, seed: int) -> None:
    scene = table(seed, palette=1)
    found = detect(scene)
    known = {item.model.name for item in scene.objects if item.known}
    assert {detection.name for detection in found.detections} == known
    assert len(found.detections) == len(known)
    assert len(found.unknown) == sum(not item.known for item in scene.objects)
    for item in scene.objects:
        if item.known:
            assert np.linalg.norm(found.find(item.model.name).pose.position - item.pose.position) < 0.004


@pytest.mark.slow
def test_an_object_that_was_taken_away_is_not_found(table: Tables) -> None:
    scene = table(61, palette=1)
    gone = next(item for item in scene.objects if item.known)
    rest = [item for item in scene.objects if item is not gone]
    without = render_table(rest, scene.table, scene.size, np.random.default_rng(61))
    assert detect(scene).find(gone.model.name) is not None
    assert detect(without).find(gone.model.name) is None


@pytest.mark.slow
def test_an_empty_table_gives_no_detection(table: Tables) -> None:
    found = detect(table(3, known=0, unknown=0))
    assert found.detections == ()
    assert found.unknown == ()


def test_all_but_the_wanted_object_are_obstacles(table: Tables) -> None:
    scene = table(60, palette=1)
    found = detect(scene)
    wanted = found.detections[0]
    assert len(found.obstacles_beside(wanted.name)) == len(scene.objects) - 1
    assert all(cluster is not wanted.cluster for cluster in found.obstacles_beside(wanted.name))
    assert len(found.obstacles_beside(None)) == len(scene.objects)


@pytest.mark.slow
def test_near_and_far_wall_of_a_cup_are_one_thing_even_where_the_segmentation_parts_them() -> None:
    cup = MODELS[0]
    table = Pose.from_xyz_rpy((0.75, 0.0, 0.75))
    item = TrueObject(cup, table @ Pose.from_xyz_rpy((0.05, 0.1, 0.05)), True)
    scene = render_table([item], table, (0.8, 1.2), np.random.default_rng(100))
    parting = PlaneDbscan(height_weight=1.0, merge_overlap=2.0)
    assert len(parting.segment(scene.view, scene.region, np.random.default_rng(0)).clusters) == 2
    assert len(PlaneDbscan().segment(scene.view, scene.region, np.random.default_rng(0)).clusters) == 1
    detector = ModelRegistration(segmentation=parting)
    found = detector.detect(scene.view, scene.region, MODELS, np.random.default_rng(0))
    assert [detection.name for detection in found.detections] == ["cup"]
    assert found.unknown == ()


def test_the_shipped_objects_are_distinguished() -> None:
    models = tuple(read_object(name) for name in ("cup", "can", "box", "crate"))
    table = Pose.from_xyz_rpy((0.7, 0.0, 0.75))
    places = [(-0.2, 0.0, 0.3), (-0.15, 0.2, 0.0), (-0.1, -0.2, 1.0), (0.15, 0.1, 0.2)]
    items = [
        TrueObject(model, table @ Pose.from_xyz_rpy((x, y, model.size[2] / 2), (0, 0, yaw)), True)
        for model, (x, y, yaw) in zip(models, places, strict=True)
    ]
    found = detect(render_table(items, table, (0.8, 1.2), np.random.default_rng(5)), models)
    assert found.unknown == ()
    for item in items:
        detection = found.find(item.model.name)
        assert detection is not None
        assert detection.confidence > 0.8
        assert np.linalg.norm(detection.pose.position - item.pose.position) < 0.003
