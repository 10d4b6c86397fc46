from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.perception_measures.segmentation import composites, judge
from benchmarks.rendered_table import RenderedTable, TrueObject, known_models, render_table
from bestman_bt.messages import CameraIntrinsics, ObjectModel, Pose, RGBDImage
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.base import Region, Segmentation, SegmentedScene
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.view import View

Tables = Callable[..., RenderedTable]
TABLE = Pose.from_xyz_rpy((0.76, 0.0, 0.75))
CUP, CAN, BOX, TIN, CUBE = known_models(0)
MUG, BOTTLE, DUCK = composites()


def segment(scene: RenderedTable, method: Segmentation | None = None) -> SegmentedScene:
    return (method or RegionGrowing()).segment(scene.view, scene.region, np.random.default_rng(0))


def on_table(*placed: tuple[ObjectModel, float, float, float], seed: int = 0) -> RenderedTable:
    items = [
        TrueObject(model, TABLE @ Pose.from_xyz_rpy((x, y, model.size[2] / 2), (0, 0, yaw)), True)
        for model, x, y, yaw in placed
    ]
    return render_table(items, TABLE, (0.8, 1.2), np.random.default_rng(seed))


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("seed", range(6))
def test_each_object_is_a_cluster_of_its_own(table: Tables, seed: int) -> None:
    scene = table(seed)
    clusters = segment(scene).clusters
    assert len(clusters) == len(scene.objects)
    assert judge(clusters, scene.objects) == (len(scene.objects), 0, 0)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("gap", "side"), [(0.0, 0.0), (0.0, math.pi / 2), (0.005, 0.0), (0.005, math.pi / 2)])
def test_things_that_touch_or_stand_millimetres_apart_come_apart_where_dbscan_joins_them(
    gap: float, side: float
) -> None:
    far = (0.05 + 0.033 + gap) * np.array([math.cos(side), math.sin(side)])
    scene = on_table((TIN, -0.1, 0.0, math.pi / 2 + side), (CAN, -0.1 + far[0], far[1], 0.0))
    assert judge(segment(scene).clusters, scene.objects) == (2, 0, 0)
    assert len(segment(scene, PlaneDbscan()).clusters) == 1


@pytest.mark.parametrize("model", [CUP, MUG, BOTTLE, DUCK], ids=lambda model: model.name)
@pytest.mark.parametrize("yaw", [0.0, *(pytest.param(yaw, marks=pytest.mark.slow) for yaw in (1.6, 3.1, -1.5))])
def test_a_thing_with_hollows_a_neck_or_a_handle_stays_whole(model: ObjectModel, yaw: float) -> None:
    scene = on_table((model, -0.2, -0.2, yaw), (model, 0.1, 0.2, yaw + 0.5))
    assert judge(segment(scene).clusters, scene.objects) == (2, 0, 0)


def test_neither_an_empty_counter_nor_the_wall_behind_it_gives_a_cluster(table: Tables) -> None:
    assert segment(table(3, known=0, unknown=0, counter=True)).clusters == ()


def test_equal_input_gives_equal_output(table: Tables) -> None:
    first, second = segment(table(1)), segment(table(1))
    np.testing.assert_array_equal(first.planes[0].frame_from_plane.matrix, second.planes[0].frame_from_plane.matrix)
    for one, other in zip(first.clusters, second.clusters, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.colors, other.colors)


def cropped(view: View, columns: slice) -> View:
    k = view.image.intrinsics
    left, right, _ = columns.indices(k.width)
    cut = CameraIntrinsics(right - left, k.height, k.fx, k.fy, k.cx - left, k.cy)
    image = RGBDImage(view.image.rgb[:, columns], view.image.depth[:, columns], cut, 0.0)
    return View(image, view.frame_from_camera)


@pytest.mark.parametrize("method", [RegionGrowing(), PlaneDbscan()], ids=["region growing", "dbscan"])
def test_a_thing_that_the_picture_cuts_is_flagged_and_no_other(method: Segmentation) -> None:
    scene = on_table((BOX, -0.1, -0.1, 0.4), (CAN, -0.1, 0.15, 0.0))
    pixels, _ = scene.view.project(scene.objects[0].pose.position[None])
    view = cropped(scene.view, slice(0, round(float(pixels[0, 0]))))
    clusters = method.segment(view, scene.region, np.random.default_rng(0)).clusters
    assert sorted(cluster.at_border for cluster in clusters) == [False, True]


@pytest.mark.parametrize("method", [RegionGrowing(), PlaneDbscan()], ids=["region growing", "dbscan"])
class TestBadInput:
    @pytest.mark.parametrize("value", [0.0, np.nan, np.inf, -1.0])
    def test_an_image_without_depth_is_reported_in_words(
        self, table: Tables, method: Segmentation, value: float
    ) -> None:
        scene = table(0)
        k = scene.view.image.intrinsics
        depth = np.full((k.height, k.width), value, dtype=np.float32)
        view = View(RGBDImage(scene.view.image.rgb, depth, k, 0.0), scene.view.frame_from_camera)
        with pytest.raises(NoSurfaceError, match="no surface in view near x .* 0 measured points"):
            method.segment(view, scene.region, np.random.default_rng(0))

    def test_unknown_pixels_count_the_same_however_they_are_written(self, table: Tables, method: Segmentation) -> None:
        scene = table(0)
        image = scene.view.image
        results = []
        for value in (0.0, np.nan, np.inf):
            depth = np.where(image.depth > 0, image.depth, np.float32(value))
            view = View(RGBDImage(image.rgb, depth, image.intrinsics, 0.0), scene.view.frame_from_camera)
            results.append(method.segment(view, scene.region, np.random.default_rng(0)))
        for other in results[1:]:
            for one, same in zip(results[0].clusters, other.clusters, strict=True):
                np.testing.assert_array_equal(one.points, same.points)

    def test_a_region_outside_the_image_is_reported(self, table: Tables, method: Segmentation) -> None:
        region = Region(Pose.from_xyz_rpy((-3.0, 0.0, 0.75)), (0.6, 1.2))
        with pytest.raises(NoSurfaceError, match="no surface in view"):
            method.segment(table(0).view, region, np.random.default_rng(0))

    @pytest.mark.parametrize("size", [1, 2, 5])
    def test_a_tiny_image_is_reported(self, table: Tables, method: Segmentation, size: int) -> None:
        k = CameraIntrinsics(size, size, 4.0, 4.0, size / 2, size / 2)
        image = RGBDImage(np.zeros((size, size, 3), np.uint8), np.ones((size, size), np.float32), k, 0.0)
        with pytest.raises(NoSurfaceError, match="no surface in view"):
            method.segment(View(image, table(0).view.frame_from_camera), table(0).region, np.random.default_rng(0))
