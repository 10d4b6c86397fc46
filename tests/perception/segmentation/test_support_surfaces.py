from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from benchmarks.rendered_shelf import RenderedShelf, camera_pose, random_shelf
from benchmarks.rendered_table import RenderedTable, render_table
from benchmarks.rendering import render_view
from bestman_bt.messages import Box, CameraIntrinsics, PlacedShape, Pose, RGBDImage
from bestman_bt.perception.errors import NoSurfaceError
from bestman_bt.perception.segmentation.base import Cluster, SupportPlane
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.segmentation.support_surfaces import SupportSurfaces, surface_regions, surface_sides
from bestman_bt.perception.view import View

Tables = Callable[..., RenderedTable]
shelf = cache(random_shelf)


@cache
def boards(scene: RenderedShelf) -> tuple[SupportPlane, ...]:
    return SupportSurfaces().find(scene.view, np.random.default_rng(0))


SHELVES = [(0, 1.2), (1, 1.6), (2, 2.0)]


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("seed", "distance"), SHELVES)
def test_every_board_is_found_at_its_height_though_seen_nearly_edge_on(seed: int, distance: float) -> None:
    scene = shelf(seed, distance)
    found = [surface.frame_from_plane.position[2] for surface in boards(scene)]
    np.testing.assert_allclose(found, scene.heights, atol=0.004)
    assert all(surface.tilt < math.radians(0.6) for surface in boards(scene))


@pytest.mark.parametrize(("seed", "distance"), SHELVES)
def test_extents_are_those_of_the_boards(seed: int, distance: float) -> None:
    scene = shelf(seed, distance)
    for surface in boards(scene):
        np.testing.assert_allclose(surface.size, scene.size, atol=0.035)
        x, y, _ = scene.shelf.inverse().apply(surface.frame_from_plane.position)
        assert abs(x) < 0.015
        assert abs(y) < 0.015


def test_x_points_away_from_the_camera_and_the_front_is_a_rim() -> None:
    scene = shelf(0, 1.2)
    for surface in boards(scene):
        away = surface.frame_from_plane.position - scene.view.viewpoint
        assert surface.frame_from_plane.rotation[:, 0] @ away > 0
        assert surface.sides[0] == "rim"


@pytest.mark.slow
def test_a_back_panel_is_a_wall_and_an_open_back_a_rim() -> None:
    assert {surface.sides[1] for surface in boards(shelf(5, 1.4, back=True))} == {"wall"}
    assert {surface.sides[1] for surface in boards(shelf(5, 1.4, back=False))} == {"rim"}


@pytest.mark.parametrize(("seed", "distance"), SHELVES)
def test_each_board_becomes_a_region_in_which_its_things_are_found(seed: int, distance: float) -> None:
    scene = shelf(seed, distance)
    found = right = 0
    for region in surface_regions(boards(scene)):
        for cluster in RegionGrowing().segment(scene.view, region, np.random.default_rng(0)).clusters:
            found += 1
            right += any(
                (np.abs(pose.inverse().apply(cluster.points)) < np.array(size) / 2 + 0.02).all(axis=1).mean() > 0.9
                for pose, size in scene.things
            )
    assert found == right
    assert right >= len(scene.things) - 1


def test_regions_end_below_the_board_above() -> None:
    regions = surface_regions(boards(shelf(0, 1.2)))
    np.testing.assert_allclose([region.height for region in regions], [0.35, 0.35, 0.25, 0.40], atol=0.01)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_table_with_things_on_it_is_one_surface(table: Tables, seed: int) -> None:
    scene = table(seed)
    found = SupportSurfaces().find(scene.view, np.random.default_rng(0))
    assert len(found) == 1
    x, y, z = scene.table.position
    assert found[0].height_at(x, y) == pytest.approx(z, abs=0.002)
    assert max(found[0].size) > 0.9


def test_a_surface_that_the_picture_cuts_is_partial_and_one_in_full_view_is_not() -> None:
    whole = render_table([], Pose.from_xyz_rpy((1.0, 0.0, 0.75)), (0.6, 0.7), np.random.default_rng(0))
    cut = render_table([], Pose.from_xyz_rpy((0.7, 0.9, 0.75)), (0.6, 0.7), np.random.default_rng(0))
    (seen,) = SupportSurfaces().find(whole.view, np.random.default_rng(0))
    assert seen.sides == ("rim", "rim", "rim", "rim")
    assert not seen.partial
    np.testing.assert_allclose(seen.size, (0.6, 0.7), atol=0.02)
    (part,) = SupportSurfaces().find(cut.view, np.random.default_rng(0))
    assert "cut" in part.sides
    assert part.partial


def test_what_is_smaller_than_the_least_size_is_no_surface_and_neither_is_the_floor() -> None:
    crate = PlacedShape(Box((0.22, 0.32, 0.3)), Pose.from_xyz_rpy((1.2, 0.0, 0.15)))
    floor = PlacedShape(Box((6.0, 6.0, 0.02)), Pose.from_xyz_rpy((2.0, 0.0, -0.01)))
    parts = [(crate, (0.2, 0.5, 0.3)), (floor, (0.5, 0.5, 0.5))]
    view = render_view(parts, camera_pose(0.0, 0.0, 0.8), np.random.default_rng(0))
    assert len(SupportSurfaces().find(view, np.random.default_rng(0))) == 1
    choosy = SupportSurfaces(min_size=(0.3, 0.4))
    with pytest.raises(NoSurfaceError, match=r"nothing horizontal above 0.10 m measures 0.30 m by 0.40 m"):
        choosy.find(view, np.random.default_rng(0))


def test_two_tables_of_one_height_with_a_gap_between_them_are_two() -> None:
    parts = [(PlacedShape(Box((6.0, 6.0, 0.02)), Pose.from_xyz_rpy((2.0, 0.0, -0.01))), (0.5, 0.5, 0.5))]
    parts.extend(
        (PlacedShape(Box((0.5, 0.6, 0.03)), Pose.from_xyz_rpy((1.3, y, 0.735))), (0.7, 0.5, 0.3)) for y in (-0.45, 0.45)
    )
    view = render_view(parts, camera_pose(0.0, 0.0, 0.6), np.random.default_rng(0))
    found = SupportSurfaces().find(view, np.random.default_rng(0))
    assert len(found) == 2
    for surface in found:
        np.testing.assert_allclose(np.sort(surface.size), (0.5, 0.6), atol=0.02)


def test_a_table_that_a_tall_box_parts_in_the_picture_is_one() -> None:
    tall = Box((0.05, 0.12, 0.75))
    parts = [
        (PlacedShape(Box((0.5, 0.9, 0.03)), Pose.from_xyz_rpy((1.1, 0.0, 0.735))), (0.7, 0.5, 0.3)),
        (PlacedShape(Box((6.0, 6.0, 0.02)), Pose.from_xyz_rpy((2.0, 0.0, -0.01))), (0.5, 0.5, 0.5)),
        (PlacedShape(tall, Pose.from_xyz_rpy((0.5, 0.0, 1.0))), (0.3, 0.3, 0.8)),
    ]
    view = render_view(parts, camera_pose(-0.2, 0.0, 0.75), np.random.default_rng(0))
    found = SupportSurfaces().find(view, np.random.default_rng(0))
    assert len(found) == 1
    assert max(found[0].size) == pytest.approx(0.9, abs=0.03)


def test_equal_input_gives_equal_output() -> None:
    first, second = (SupportSurfaces().find(shelf(0, 1.2).view, np.random.default_rng(3)) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.frame_from_plane.matrix, other.frame_from_plane.matrix)
        assert one.size == other.size


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_an_image_without_depth_is_reported_in_words(value: float) -> None:
    k = CameraIntrinsics(64, 48, 60.0, 60.0, 32.0, 24.0)
    image = RGBDImage(np.zeros((48, 64, 3), np.uint8), np.full((48, 64), value, np.float32), k, 0.0)
    with pytest.raises(NoSurfaceError, match="the image has no depth"):
        SupportSurfaces().find(View(image, camera_pose(0.0, 0.0, 0.5)), np.random.default_rng(0))


@pytest.mark.parametrize("size", [1, 3, 8])
def test_a_tiny_image_is_reported_in_words(size: int) -> None:
    k = CameraIntrinsics(size, size, 4.0, 4.0, size / 2, size / 2)
    image = RGBDImage(np.zeros((size, size, 3), np.uint8), np.ones((size, size), np.float32), k, 0.0)
    with pytest.raises(NoSurfaceError, match="nothing horizontal"):
        SupportSurfaces().find(View(image, camera_pose(0.0, 0.0, 0.5)), np.random.default_rng(0))


def test_each_side_is_looked_at_along_its_own_length(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []

    def edge_kind(view: View, plane: Pose, edge: np.ndarray, outward: np.ndarray) -> str:
        looked.append((tuple(outward), edge.min(axis=0).tolist(), edge.max(axis=0).tolist()))
        return "rim"

    monkeypatch.setattr("bestman_bt.perception.segmentation.support_surfaces.edge_kind", edge_kind)
    assert surface_sides(shelf(*SHELVES[0]).view, Pose(), (0.4, 2.0)) == ("rim",) * 4
    assert [side for side, _, _ in looked] == [(-1, 0), (1, 0), (0, -1), (0, 1)]
    lowest, highest = (
        [[-0.2, -0.9], [0.2, -0.9], [-0.18, -1.0], [-0.18, 1.0]],
        [[-0.2, 0.9], [0.2, 0.9], [0.18, -1.0], [0.18, 1.0]],
    )
    np.testing.assert_allclose([low for _, low, _ in looked], lowest)
    np.testing.assert_allclose([high for _, _, high in looked], highest)


def test_the_obstacle_around_a_thing_grows_to_the_sides_and_above_and_still_stands_on_its_surface() -> None:
    plane = SupportPlane(Pose.from_xyz_rpy((1.0, 2.0, 0.7), (0.0, 0.0, 0.8)), (1.0, 1.0), np.zeros((0, 3)), 0.001)
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.02, 0.02) for z in (0.0, 0.3)])
    thing = Cluster(plane.frame_from_plane.apply(corners), np.zeros((8, 3), dtype=np.uint8), plane)
    obstacle = thing.obstacle(0.01)
    assert isinstance(obstacle.shape, Box)
    assert sorted(obstacle.shape.size) == pytest.approx([0.06, 0.22, 0.31], abs=1e-4)
    np.testing.assert_allclose(obstacle.pose.position, (1.0, 2.0, 0.7 + 0.31 / 2), atol=1e-4)
