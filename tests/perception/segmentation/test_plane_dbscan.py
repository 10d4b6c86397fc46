from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable, TrueObject
from bestman_bt.messages import Box, PlacedShape, Pose, RGBDImage
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.base import Region, SegmentedScene
from bestman_bt.perception.segmentation.plane_dbscan import Open3DDbscan, PlaneDbscan, dbscan
from bestman_bt.perception.view import View
from tests.perception.seen_boxes import looking_at, view_of

Tables = Callable[..., RenderedTable]
Segment = Callable[[RenderedTable], SegmentedScene]
SEEDS = range(6)
ALGORITHMS = [PlaneDbscan, pytest.param(Open3DDbscan, marks=pytest.mark.slow)]


@pytest.fixture(params=ALGORITHMS)
def algorithm(request: pytest.FixtureRequest) -> type[PlaneDbscan]:
    if request.param is Open3DDbscan:
        request.getfixturevalue("needs_open3d")
    return request.param


@pytest.fixture
def segment(algorithm: type[PlaneDbscan]) -> Segment:
    """How scenes are segmented, each once."""
    return partial(segmented, algorithm)


@cache
def segmented(algorithm: type[PlaneDbscan], scene: RenderedTable) -> SegmentedScene:
    return algorithm().segment(scene.view, scene.region, np.random.default_rng(0))


def share_inside(points: np.ndarray, item: TrueObject) -> float:
    local = item.pose.inverse().apply(points)
    return float((np.abs(local) < item.model.size / 2 + 0.01).all(axis=1).mean())


@pytest.mark.parametrize("seed", SEEDS)
def test_the_surface_is_measured_to_a_millimetre_and_a_fifth_of_a_degree(
    table: Tables, segment: Segment, seed: int
) -> None:
    scene = table(seed)
    plane = segment(scene).planes[0]
    x, y, z = scene.table.position
    assert plane.height_at(x, y) == pytest.approx(z, abs=0.001)
    assert plane.tilt < math.radians(0.2)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_front_edge_is_found_within_six_millimetres(table: Tables, segment: Segment, seed: int) -> None:
    scene = table(seed)
    plane = segment(scene).planes[0]
    half_x, half_y = plane.size[0] / 2, 0.25
    corners = plane.frame_from_plane.apply(np.array([[-half_x, -half_y, 0.0], [-half_x, half_y, 0.0]]))
    front = scene.table.inverse().apply(corners)[:, 0]
    np.testing.assert_allclose(front, -scene.size[0] / 2, atol=0.006)


@pytest.mark.parametrize("seed", SEEDS)
def test_each_object_is_a_cluster_of_its_own(table: Tables, segment: Segment, seed: int) -> None:
    scene = table(seed)
    clusters = segment(scene).clusters
    for cluster in clusters:
        assert max(share_inside(cluster.points, item) for item in scene.objects) > 0.9
    for item in scene.objects:
        assert sum(share_inside(cluster.points, item) > 0.9 for cluster in clusters) == 1


def test_neither_an_empty_counter_nor_the_wall_behind_it_gives_a_cluster(table: Tables, segment: Segment) -> None:
    assert segment(table(3, known=0, unknown=0, counter=True)).clusters == ()


def test_the_bounding_box_of_a_box_is_its_size_and_place(table: Tables, segment: Segment) -> None:
    scene = table(40, known=0, unknown=3)
    boxes = [item for item in scene.objects if item.model.symmetry_order == 2]
    assert boxes
    for item in boxes:
        cluster = max(segment(scene).clusters, key=lambda c: share_inside(c.points, item))
        box = cluster.bounding_box
        np.testing.assert_allclose(np.sort(box.shape.size), np.sort(item.model.size), atol=0.010)
        np.testing.assert_allclose(box.pose.position, item.pose.position, atol=0.006)


def test_equal_input_gives_equal_output(table: Tables, algorithm: type[PlaneDbscan]) -> None:
    scene = table(1)
    first, second = (algorithm().segment(scene.view, scene.region, np.random.default_rng(0)) for _ in range(2))
    np.testing.assert_array_equal(first.planes[0].frame_from_plane.matrix, second.planes[0].frame_from_plane.matrix)
    for one, other in zip(first.clusters, second.clusters, strict=True):
        np.testing.assert_array_equal(one.points, other.points)


def with_depth(scene: RenderedTable, depth: np.ndarray) -> View:
    image = scene.view.image
    return View(RGBDImage(image.rgb, depth, image.intrinsics, 0.0), scene.view.frame_from_camera)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_an_image_without_depth_is_reported_in_words(table: Tables, value: float) -> None:
    view = with_depth(table(0), np.full((480, 640), value, dtype=np.float32))
    with pytest.raises(NoSurfaceError, match="no surface in view near x .* 0 measured points"):
        PlaneDbscan().segment(view, table(0).region, np.random.default_rng(0))


def test_a_surface_that_is_not_where_it_is_expected_is_reported(table: Tables) -> None:
    scene = table(0)
    lifted = Pose(np.array([0.0, 0.0, 0.5])) @ scene.region.frame_from_surface
    with pytest.raises(NoSurfaceError, match="no surface in view"):
        PlaneDbscan().segment(scene.view, replace(scene.region, frame_from_surface=lifted), np.random.default_rng(0))


def test_a_region_outside_the_image_is_reported(table: Tables) -> None:
    region = Region(Pose.from_xyz_rpy((-3.0, 0.0, 0.75)), (0.6, 1.2))
    with pytest.raises(NoSurfaceError, match="no surface in view"):
        PlaneDbscan().segment(table(0).view, region, np.random.default_rng(0))


def test_dbscan_parts_what_is_farther_apart_than_its_distance() -> None:
    rng = np.random.default_rng(0)
    blob = rng.uniform(0.0, 0.03, (400, 3))
    lone = np.array([[0.5, 0.5, 0.5]])
    points = np.concatenate([blob, blob + np.array([0.06, 0.0, 0.0]), lone])
    labels = dbscan(points, 0.015, 4)
    assert set(labels[:400]) == {labels[0]}
    assert set(labels[400:800]) == {labels[400]}
    assert sorted({int(labels[0]), int(labels[400])}) == [0, 1]
    assert labels[800] == -1


def test_dbscan_joins_what_is_nearer() -> None:
    blob = np.random.default_rng(0).uniform(0.0, 0.03, (400, 3))
    assert set(dbscan(np.concatenate([blob, blob + np.array([0.035, 0.0, 0.0])]), 0.015, 4)) == {0}


@pytest.mark.parametrize(("board", "at"), [((0.5, 0.7), 0.0), ((0.5, 0.9), 0.0), ((0.3, 1.0), -0.15)])
def test_a_board_on_most_of_a_table_is_a_thing_on_it_and_not_the_surface(
    algorithm: type[PlaneDbscan], board: tuple[float, float], at: float
) -> None:
    table = PlacedShape(Box((0.6, 1.0, 0.04)), Pose(np.array([0.8, 0.0, 0.73])))
    tray = PlacedShape(Box((*board, 0.03)), Pose(np.array([0.8 + at, 0.0, 0.765])))
    view = view_of([table, tray], looking_at((0.0, 0.1, 1.5), (0.8, 0.0, 0.75)), rng=np.random.default_rng(2))
    region = Region(Pose(np.array([0.8, 0.0, 0.76])), (0.64, 1.04))
    scene = algorithm().segment(view, region, np.random.default_rng(0))
    assert scene.planes[0].height_at(0.8, 0.0) == pytest.approx(0.75, abs=0.002)
    np.testing.assert_allclose(scene.planes[0].size, (0.6, 1.0), atol=0.02)
    (thing,) = scene.clusters
    assert float(thing.points[:, 2].max()) == pytest.approx(0.78, abs=0.008)


@pytest.mark.parametrize(("table", "thickness"), [((0.572, 0.506), 0.018), ((0.352, 0.627), 0.019)])
def test_a_low_board_on_half_of_a_table_does_not_tilt_its_plane(table: tuple[float, float], thickness: float) -> None:
    """A plane that slants from the table up to the board has as many points as the table."""
    depth, width = table
    top = PlacedShape(Box((depth, width, 0.04)), Pose(np.array([0.8, 0.0, 0.73])))
    board = PlacedShape(
        Box((0.71 * depth, 0.71 * width, thickness)),
        Pose(np.array([0.8 + 0.12 * depth, 0.1 * width, 0.75 + thickness / 2])),
    )
    region = Region(Pose(np.array([0.8, 0.0, 0.76])), (depth + 0.04, width + 0.04))
    for seed in range(3):
        view = view_of([top, board], looking_at((0.0, 0.1, 1.5), (0.8, 0.0, 0.75)), rng=np.random.default_rng(seed))
        plane = PlaneDbscan().segment(view, region, np.random.default_rng(seed)).planes[0]
        assert plane.height_at(0.8, 0.0) == pytest.approx(0.75, abs=0.002)
        assert plane.tilt < math.radians(0.5)
