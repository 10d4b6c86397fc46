from __future__ import annotations

import numpy as np
import pytest

from benchmarks.navigation_measures.map_quality import rigid_alignment
from benchmarks.navigation_measures.true_surfaces import TrueSurfaces
from bestman_bt.messages import Pose2D
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene


def test_alignment_takes_a_shift_and_a_turn_away_and_nothing_else():
    points = np.random.default_rng(1).uniform(-5.0, 5.0, (30, 2))
    moved = Pose2D(1.2, -0.4, 2.5)
    found = rigid_alignment(points, moved.apply(points))
    assert (found.x, found.y, found.theta) == pytest.approx((1.2, -0.4, 2.5))
    stretched = points * [1.1, 1.0]
    assert np.abs(rigid_alignment(points, stretched).apply(points) - stretched).max() > 0.2


def test_true_surfaces_are_what_the_plane_of_the_lidar_cuts():
    world = draw_world(load_scene("kitchen"), 0)
    low, high = TrueSurfaces(world, 0.2), TrueSurfaces(world, 5.0)
    assert len(high.segments) < len(low.segments)  # above everything, only walls are left, which the map has
    gaps = np.linalg.norm(np.diff(low.points[:50], axis=0), axis=1)
    assert np.median(gaps) <= 0.0101
