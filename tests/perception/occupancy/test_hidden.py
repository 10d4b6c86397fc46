"""What part of a surface no view has shown."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import VOXEL_FREE, VOXEL_OCCUPIED, VOXEL_UNKNOWN, Pose, VoxelGrid
from bestman_bt.perception.occupancy import hidden_share

SURFACE = Pose.from_xyz_rpy((1.0, -2.0, 0.7), (0.0, 0.0, 0.6))
SIZE = (0.6, 1.2)
STEP = 0.02


def grid(hidden: slice, along: slice = slice(None), heights: slice = slice(None)) -> VoxelGrid:
    """A surface that was measured, with free space above it, but for the ``hidden`` columns along its y."""
    states = np.full((30, 60, 20), VOXEL_FREE, dtype=np.uint8)
    states[:, :, 4] = VOXEL_OCCUPIED
    states[:, :, :4] = VOXEL_UNKNOWN
    states[along, hidden, heights] = VOXEL_UNKNOWN
    return VoxelGrid(states, STEP, SURFACE @ Pose(np.array([-0.3, -0.6, -0.1])), 1.0)


def test_of_a_surface_that_was_seen_nothing_is_hidden() -> None:
    assert hidden_share(grid(slice(0)), SURFACE, SIZE, 0.08) == 0.0


def test_behind_an_arm_there_is_room_for_a_cup_but_not_for_a_plate() -> None:
    behind_the_arm = grid(slice(20, 26))  # a strip of 12 cm
    assert hidden_share(behind_the_arm, SURFACE, SIZE, 0.08) == pytest.approx(6 / 57, abs=0.03)
    assert hidden_share(behind_the_arm, SURFACE, SIZE, 0.3) == 0.0


def test_space_that_was_seen_high_above_a_surface_tells_nothing_of_what_stands_on_it() -> None:
    assert hidden_share(grid(slice(20, 26), heights=slice(0, 9)), SURFACE, SIZE, 0.08) > 0.05


def test_where_no_view_reached_all_is_hidden() -> None:
    elsewhere = SURFACE @ Pose(np.array([3.0, 0.0, 0.0]))
    assert hidden_share(grid(slice(0)), elsewhere, SIZE, 0.08) == 1.0


def test_a_second_view_shows_what_the_first_did_not() -> None:
    first, second = grid(slice(0, 30)), grid(slice(20, 60))
    both = second.with_unknown_from(first)
    assert hidden_share(first, SURFACE, SIZE, 0.08) > 0.4
    assert hidden_share(both, SURFACE, SIZE, 0.08) == pytest.approx(10 / 57, abs=0.04)
    assert (both.states[:, :20, 4] == VOXEL_OCCUPIED).all()
