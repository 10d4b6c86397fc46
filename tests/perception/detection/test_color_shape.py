from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.crowded_table import crowded_table
from benchmarks.perception_measures.known_objects import shares_place, shipped_models
from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, recolored, render_table, solid
from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose
from bestman_bt.perception.detection.base import DetectedScene
from bestman_bt.perception.detection.color_shape import ColorShape
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.base import PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.view import View

Tables = Callable[..., RenderedTable]
TABLE = Pose.from_xyz_rpy((0.76, 0.0, 0.75))
GREY = (0.6, 0.6, 0.6)
shipped = cache(shipped_models)
DETECTOR = ColorShape()


@cache
def crowd(seed: int) -> RenderedTable:
    return crowded_table(seed, shipped(), count=(5, 5))


class Counting(PoseEstimator):
    """The usual estimator, and how many models it was given."""

    def __init__(self) -> None:
        self.usual = MultiStart()
        self.tried = 0

    def estimate(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        self.tried += len(models)
        return self.usual.estimate(cluster, models, view)


def on_table(*placed: tuple[ObjectModel, float, float, float]) -> RenderedTable:
    items = [
        TrueObject(model, TABLE @ Pose.from_xyz_rpy((x, y, model.size[2] / 2), (0, 0, yaw)), True)
        for model, x, y, yaw in placed
    ]
    return render_table(items, TABLE, (0.8, 1.2), np.random.default_rng(1))


def detect(
    scene: RenderedTable, models: Sequence[ObjectModel], estimator: PoseEstimator | None = None
) -> DetectedScene:
    detector = ColorShape(pose_estimator=estimator) if estimator else DETECTOR
    return detector.detect(scene.view, scene.region, models, np.random.default_rng(0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_the_shipped_objects_are_named_and_few_models_are_tried(seed: int) -> None:
    scene = crowd(seed)
    estimator = Counting()
    found = detect(scene, shipped(), estimator)
    for item in scene.objects:
        assert [d.name for d in found.detections if shares_place(d, item)] == [item.model.name]
    assert len(found.detections) == len(scene.objects)
    assert estimator.tried <= 2 * len(scene.objects)


@pytest.mark.slow
def test_equal_colours_are_distinguished_by_shape() -> None:
    models = [replace(recolored(model, GREY), visual_colors=()) for model in shipped()]
    scene = crowded_table(1, models, count=(6, 6))
    found = detect(scene, models)
    for item in scene.objects:
        assert [d.name for d in found.detections if shares_place(d, item)] == [item.model.name]


@pytest.mark.slow
def test_equal_shapes_are_distinguished_by_colour() -> None:
    colors = {"red": (0.8, 0.2, 0.2), "green": (0.2, 0.7, 0.3), "white": (0.9, 0.9, 0.9), "black": (0.15, 0.15, 0.15)}
    models = [solid(name, Box((0.05, 0.07, 0.09)), color, 2) for name, color in colors.items()]
    scene = on_table(*((model, -0.15, -0.3 + 0.2 * i, 0.4 * i) for i, model in enumerate(models)))
    found = detect(scene, models)
    for item in scene.objects:
        assert [d.name for d in found.detections if shares_place(d, item)] == [item.model.name]


def bottle(name: str, cap: tuple[float, float, float]) -> ObjectModel:
    body, top = Cylinder(0.03, 0.10), Cylinder(0.016, 0.03)
    parts = (PlacedShape(body, Pose()), PlacedShape(top, Pose.from_xyz_rpy((0.0, 0.0, 0.065))))
    green = (0.2, 0.5, 0.3)
    return ObjectModel(name, green, 0.2, 0.8, parts, parts, 0, (green, cap))


@pytest.mark.slow
def test_things_of_two_colours_are_told_from_things_of_one() -> None:
    models = [bottle("capped", (0.9, 0.2, 0.2)), bottle("plain", (0.2, 0.5, 0.3))]
    for model in models:
        item = TrueObject(model, TABLE @ Pose.from_xyz_rpy((-0.1, 0.0, 0.05)), True)
        scene = render_table([item], TABLE, (0.8, 1.2), np.random.default_rng(1))
        assert [d.name for d in detect(scene, models).detections] == [model.name]


@pytest.mark.slow
def test_an_object_that_was_taken_away_is_not_found() -> None:
    scene = crowd(0)
    assert detect(scene, shipped()).find(scene.objects[0].model.name) is not None
    without = render_table(scene.objects[1:], scene.table, scene.size, np.random.default_rng(2))
    assert detect(without, shipped()).find(scene.objects[0].model.name) is None


def test_things_of_another_shape_or_another_colour_stay_unknown() -> None:
    cup, can, box, tin, cube = known_models(0)
    scene = on_table((recolored(can, (0.9, 0.1, 0.7)), -0.1, -0.2, 0.0), (box, -0.1, 0.0, 0.3), (tin, -0.1, 0.2, 0.3))
    small = solid("small", Box((0.055, 0.10, 0.055)), tin.color, 2)
    found = detect(scene, [cup, can, cube, small])
    assert found.detections == ()
    assert len(found.unknown) == 3


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(40, 43))
def test_unknown_things_beside_known_ones_stay_unknown(table: Tables, seed: int) -> None:
    scene = table(seed, palette=1)
    found = detect(scene, known_models(1))
    assert {d.name for d in found.detections} == {item.model.name for item in scene.objects if item.known}
    assert len(found.unknown) == sum(not item.known for item in scene.objects)


def test_an_empty_table_gives_no_detection(table: Tables) -> None:
    found = detect(table(3, known=0, unknown=0), known_models(0))
    assert found.detections == ()
    assert found.unknown == ()


def test_without_models_all_is_unknown(table: Tables) -> None:
    assert len(detect(table(3), ()).unknown) == len(table(3).objects)


def test_equal_input_gives_equal_output(table: Tables) -> None:
    scene = table(3)
    first, second = detect(scene, known_models(3)), detect(scene, known_models(3))
    assert first.detections
    assert [d.name for d in first.detections] == [d.name for d in second.detections]
    for one, other in zip(first.detections, second.detections, strict=True):
        np.testing.assert_array_equal(one.pose.matrix, other.pose.matrix)


def test_a_model_without_shapes_is_refused_in_words() -> None:
    cup = known_models(0)[0]
    scene = on_table((cup, -0.1, 0.0, 0.0))
    with pytest.raises(PerceptionError, match="model 'ghost' has no shapes"):
        detect(scene, [replace(cup, name="ghost", collision=(), visual=())])
