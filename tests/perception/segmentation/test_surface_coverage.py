from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.rendered_table import RenderedTable, TrueObject, render_table, solid
from bestman_bt.messages import Box, Pose
from bestman_bt.perception.segmentation.plane_dbscan import PlaneDbscan
from bestman_bt.perception.segmentation.surface_coverage import (
    ABSENT,
    FREE,
    OCCUPIED,
    UNSEEN,
    SurfaceCoverage,
    surface_coverage,
)

Tables = Callable[..., RenderedTable]
COUNTER = Pose.from_xyz_rpy((0.65, 0.0, 0.9))


def coverage(scene: RenderedTable) -> SurfaceCoverage:
    segmented = PlaneDbscan().segment(scene.view, scene.region, np.random.default_rng(0))
    return surface_coverage(scene.view, scene.region, segmented)


def counter_with(positions: list[tuple[float, float]]) -> RenderedTable:
    model = solid("block", Box((0.05, 0.05, 0.10)), (0.7, 0.2, 0.3), 4)
    objects = [TrueObject(model, COUNTER @ Pose.from_xyz_rpy((x, y, 0.05)), False) for x, y in positions]
    return render_table(objects, COUNTER, (0.6, 0.8), np.random.default_rng(1), wall_behind=True)


@pytest.fixture(scope="module")
def crowded() -> SurfaceCoverage:
    """Blocks so dense that no disc of 12 cm has room between them."""
    return coverage(counter_with([(x, y) for x in np.arange(-0.25, 0.26, 0.1) for y in np.arange(-0.35, 0.36, 0.1)]))


@pytest.mark.slow
def test_a_crowded_counter_has_no_free_disc_of_twelve_centimetres(crowded: SurfaceCoverage) -> None:
    assert crowded.free_discs(0.06, np.array([0.6, 0.0])).shape == (0, 3)


@pytest.mark.slow
def test_a_crowded_counter_still_has_small_free_places(crowded: SurfaceCoverage) -> None:
    assert len(crowded.free_discs(0.015, np.array([0.6, 0.0]))) > 0


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_free_discs_keep_clear_of_every_object_and_edge_and_come_nearest_first(table: Tables, seed: int) -> None:
    scene = table(seed)
    goal = scene.objects[0].pose.position
    discs = coverage(scene).free_discs(0.06, goal)
    assert len(discs) > 100
    for item in scene.objects:
        inner = min(item.model.size[:2]) / 2
        assert np.linalg.norm(discs[:, :2] - item.pose.position[:2], axis=1).min() > 0.06 + inner - 0.006
    local = scene.table.inverse().apply(discs)
    assert (np.abs(local[:, :2]) < np.array(scene.size) / 2 - 0.06 + 0.008).all()
    np.testing.assert_allclose(local[:, 2], 0.0, atol=0.001)
    distances = np.linalg.norm(discs[:, :2] - goal[:2], axis=1)
    assert (np.diff(distances) >= 0).all()


def test_a_disc_is_sorted_into_free_taken_absent_and_unseen() -> None:
    scene = counter_with([(0.0, 0.0)])
    cells = coverage(scene)
    assert cells.disc(COUNTER.apply([0.0, 0.0, 0.0]), 0.02)[OCCUPIED] > 0.95
    assert cells.disc(COUNTER.apply([-0.1, 0.2, 0.0]), 0.05)[FREE] > 0.95
    assert cells.disc(COUNTER.apply([-0.325, 0.0, 0.0]), 0.01)[ABSENT] > 0.5
    assert cells.disc(COUNTER.apply([0.07, 0.0, 0.0]), 0.02)[UNSEEN] > 0.5
    assert cells.disc(np.array([5.0, 5.0]), 0.05)[UNSEEN] == 1.0


def test_an_empty_counter_is_seen_nearly_completely() -> None:
    cells = coverage(counter_with([]))
    assert (cells.cells == FREE).sum() * cells.resolution**2 == pytest.approx(0.6 * 0.8, rel=0.05)
