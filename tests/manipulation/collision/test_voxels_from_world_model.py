"""Which voxels of a grid become obstacles: those within reach that no believed body explains."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.manipulation.collision.scene_from_world_model import voxel_obstacles
from bestman_bt.messages import VOXEL_FREE, VOXEL_OCCUPIED, VOXEL_UNKNOWN, Box, PlacedShape, Pose, Pose2D, VoxelGrid

BASE_FROM_MAP = Pose2D(3.0, -1.0, 2.2).to_pose().inverse()
MAP_FROM_GRID = Pose.from_xyz_rpy((2.5, -0.6, 0.4), (0.0, 0.0, 0.3))
EDGE = 0.05


def grid(*indices: tuple[int, int, int], state: int = VOXEL_OCCUPIED) -> VoxelGrid:
    states = np.full((8, 8, 4), VOXEL_FREE, dtype=np.uint8)
    states[tuple(np.array(indices).T)] = state
    return VoxelGrid(states, EDGE, MAP_FROM_GRID, 0.0)


def obstacles(of: VoxelGrid, *explained: PlacedShape, slack: float = 0.01, reach: float = 5.0, unknown: bool = False):
    return voxel_obstacles(of, BASE_FROM_MAP, explained, slack=slack, reach=reach, unknown=unknown)


def middle(index: tuple[int, int, int]) -> np.ndarray:
    """Of a voxel, in the base frame."""
    return (BASE_FROM_MAP @ MAP_FROM_GRID).apply((np.array(index) + 0.5) * EDGE)


def box_beside(index: tuple[int, int, int], gap: float) -> PlacedShape:
    """A box whose side is ``gap`` metres from the middle of a voxel, away from it along x."""
    place = middle(index) + np.array([gap + 0.05, 0.0, 0.0])
    return PlacedShape(Box((0.1, 0.1, 0.1)), Pose(place))


def test_filled_voxels_stand_where_the_grid_has_them_seen_from_the_base() -> None:
    (seen,) = obstacles(grid((1, 2, 3), (4, 0, 1)))
    assert seen.name == "occupied"
    assert seen.indices.tolist() == [[1, 2, 3], [4, 0, 1]]
    assert seen.resolution == EDGE
    assert np.allclose(seen.base_from_grid.apply((seen.indices[0] + 0.5) * EDGE), middle((1, 2, 3)))


@pytest.mark.parametrize(("beyond", "kept"), [(-0.001, False), (0.001, True)])
def test_a_voxel_is_explained_up_to_the_slack_beside_its_outermost_corner(beyond: float, kept: bool) -> None:
    gap = 0.01 + np.sqrt(3.0) / 2 * EDGE + beyond
    assert bool(obstacles(grid((3, 3, 2)), box_beside((3, 3, 2), gap))) is kept


def test_each_of_several_bodies_explains_what_it_touches() -> None:
    seen = grid((0, 0, 0), (7, 7, 3), (3, 3, 2))
    (left,) = obstacles(seen, box_beside((0, 0, 0), 0.0), box_beside((7, 7, 3), 0.0))
    assert left.indices.tolist() == [[3, 3, 2]]


def test_voxels_count_within_reach_of_the_base_whatever_their_height() -> None:
    index = (3, 3, 3)
    away = float(np.hypot(*middle(index)[:2]))
    assert obstacles(grid(index), reach=away + 1e-6)
    assert obstacles(grid(index), reach=away - 1e-6) == ()


def test_unseen_voxels_count_only_when_asked() -> None:
    unseen = grid((1, 1, 1), state=VOXEL_UNKNOWN)
    assert obstacles(unseen) == ()
    (found,) = obstacles(unseen, unknown=True)
    assert (found.name, found.indices.tolist()) == ("unknown", [[1, 1, 1]])
