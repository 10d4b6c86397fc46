from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, render_table, solid
from bestman_bt.messages import Box, ObjectModel, Pose
from bestman_bt.perception.pose_estimation.base import PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan

Tables = Callable[..., RenderedTable]
ESTIMATOR = MultiStart()
ALIKE = 3


@cache
def clusters_of(scene: RenderedTable) -> tuple[Cluster, ...]:
    return PlaneDbscan().segment(scene.view, scene.region, np.random.default_rng(0)).clusters


def hypotheses(
    scene: RenderedTable, item: TrueObject, models: tuple[ObjectModel, ...], estimator: MultiStart = ESTIMATOR
) -> tuple[PoseHypothesis, ...]:
    nearest = min(clusters_of(scene), key=lambda c: np.linalg.norm(c.bounding_box.pose.position - item.pose.position))
    return estimator.estimate(nearest, models, scene.view)


def yaw_error(hypothesis: PoseHypothesis, item: TrueObject) -> float:
    order = item.model.symmetry_order
    if order == 0:
        return 0.0
    span = 2 * math.pi / order
    return abs((hypothesis.pose.yaw - item.pose.yaw + span / 2) % span - span / 2)


@pytest.mark.parametrize("seed", [20, 21, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (22, 23))])
def test_known_objects_are_named_and_placed_although_all_have_one_colour(table: Tables, seed: int) -> None:
    scene = table(seed, palette=ALIKE, known=4, unknown=0)
    assert len(scene.objects) == 4
    for item in scene.objects:
        best = hypotheses(scene, item, known_models(ALIKE))[0]
        assert best.model.name == item.model.name
        assert best.confidence > 0.8
        assert np.linalg.norm((best.pose.position - item.pose.position)[:2]) < max(0.0015, 3 * best.position_std)
        assert best.pose.position[2] == pytest.approx(item.pose.position[2], abs=0.0015)
        assert yaw_error(best, item) < math.radians(4.0)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", range(20, 23))
def test_a_wrong_model_gets_a_low_confidence(table: Tables, seed: int) -> None:
    scene = table(seed, palette=ALIKE, known=4, unknown=0)
    for item in scene.objects:
        wrong = tuple(model for model in known_models(ALIKE) if model.name != item.model.name)
        assert all(hypothesis.confidence < 0.5 for hypothesis in hypotheses(scene, item, wrong))


def test_an_open_cup_is_told_from_a_can_of_equal_size_and_colour(table: Tables) -> None:
    cup, can = known_models(ALIKE)[:2]
    place = Pose.from_xyz_rpy((0.7, 0.0, 0.75))
    items = [TrueObject(m, place @ Pose.from_xyz_rpy((-0.1, y, 0.05)), True) for m, y in ((cup, -0.1), (can, 0.1))]
    scene = render_table(items, place, (0.8, 1.2), np.random.default_rng(2))
    for item in items:
        first, second = hypotheses(scene, item, (cup, can))
        assert first.model.name == item.model.name
        assert first.confidence > 0.9
        assert second.confidence < 0.2


def test_colour_alone_tells_two_cans_apart(table: Tables) -> None:
    can = known_models(0)[1]
    other = ObjectModel("other", (0.8, 0.3, 0.1), 0.2, 0.8, can.collision, symmetry_order=0)
    place = Pose.from_xyz_rpy((0.7, 0.0, 0.75))
    item = TrueObject(other, place @ Pose.from_xyz_rpy((-0.1, 0.0, 0.05)), True)
    scene = render_table([item], place, (0.8, 1.2), np.random.default_rng(3))
    best, *rest = hypotheses(scene, item, (can, other))
    assert best.model.name == "other"
    assert all(hypothesis.confidence < 0.05 for hypothesis in rest)


def test_a_fallen_can_is_found_lying_where_that_is_asked_for() -> None:
    can = known_models(0)[1]
    place = Pose.from_xyz_rpy((0.7, 0.0, 0.75))
    pose = place @ Pose.from_xyz_rpy((-0.1, 0.0, 0.033), (math.pi / 2, 0.0, 0.4))
    scene = render_table([TrueObject(can, pose, True)], place, (0.8, 1.2), np.random.default_rng(4))
    best = hypotheses(scene, scene.objects[0], (can,), MultiStart(tipped=True))[0]
    assert not best.upright
    assert best.confidence > 0.8
    assert np.linalg.norm(best.pose.position - pose.position) < 0.003
    assert abs(best.pose.rotation[:, 2] @ pose.rotation[:, 2]) > math.cos(math.radians(3.0))
    assert all(h.confidence < 0.5 for h in hypotheses(scene, scene.objects[0], (can,)))


def test_equal_input_gives_equal_output(table: Tables) -> None:
    scene = table(20, palette=ALIKE, known=4, unknown=0)
    first = hypotheses(scene, scene.objects[0], known_models(ALIKE))
    second = hypotheses(scene, scene.objects[0], known_models(ALIKE), MultiStart())
    assert [h.confidence for h in first] == [h.confidence for h in second]
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.pose.matrix, other.pose.matrix)


def test_no_model_is_proposed_for_a_thing_of_quite_another_size(table: Tables) -> None:
    scene = table(20, palette=ALIKE, known=4, unknown=0)
    tall = next(item for item in scene.objects if item.model.size[2] > 0.09)
    cube = tuple(model for model in known_models(ALIKE) if model.name == "cube")
    assert hypotheses(scene, tall, cube) == ()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_bar_of_which_another_thing_hides_one_end_is_placed_by_the_other(side: float) -> None:
    bar = solid("bar", Box((0.16, 0.03, 0.03)), (0.5, 0.2, 0.2), 2)
    screen = solid("screen", Box((0.02, 0.06, 0.10)), (0.2, 0.5, 0.3), 2)
    place = Pose.from_xyz_rpy((0.7, 0.0, 0.75))
    items = [
        TrueObject(bar, place @ Pose.from_xyz_rpy((-0.1, 0.0, 0.015), (0, 0, math.pi / 2)), True),
        TrueObject(screen, place @ Pose.from_xyz_rpy((-0.16, 0.06 * side, 0.05)), True),
    ]
    scene = render_table(items, place, (0.8, 1.2), np.random.default_rng(6))
    best = hypotheses(scene, items[0], (bar,))[0]
    assert best.confidence > 0.8
    assert np.linalg.norm(best.pose.position - items[0].pose.position) < 0.006
