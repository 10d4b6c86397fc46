"""Where a front is, by the hits on it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.localization.front_edge import front_edge
from bestman_bt.world_model.semantic_map import MapFurniture

COUNTER = MapFurniture("counter", Pose2D(2.0, 1.0, 0.4), (0.6, 1.6), 0.9, (), True)


def hits(offset: float, turn: float, width: float = 1.4, seed: int = 0) -> np.ndarray:
    """What a lidar sees of the front of a counter that is ``offset`` nearer and turned, with handles and a wall."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-width / 2, width / 2, 150)
    front = COUNTER.pose @ Pose2D(-COUNTER.footprint[0] / 2 - offset, 0.0, turn)
    seen = front.apply(np.column_stack([rng.normal(0.0, 0.01, 150), along]))
    handles = front.apply(np.column_stack([np.full(12, -0.04), rng.uniform(0.07, 0.14, 12) * width]))
    wall = front.apply(np.column_stack([np.full(40, 0.6), np.linspace(-2.0, 2.0, 40)]))
    return np.vstack([seen, handles, wall])


@pytest.mark.parametrize(("offset", "turn"), [(0.0, 0.0), (0.03, 0.03), (-0.025, -0.02), (0.03, -0.035)])
def test_a_displaced_front_is_found_in_spite_of_handles_and_walls(offset, turn) -> None:
    edge = front_edge(COUNTER, hits(offset, turn))
    assert edge is not None
    assert edge.offset == pytest.approx(offset, abs=0.003)
    assert edge.turn == pytest.approx(turn, abs=0.005)


def test_a_stand_is_moved_with_the_front() -> None:
    edge = front_edge(COUNTER, hits(0.03, 0.02))
    assert edge is not None
    on_map = COUNTER.pose @ Pose2D(-0.8, 0.3, 0.0)
    true_front = COUNTER.pose @ Pose2D(-0.33, 0.0, 0.02)
    wanted = true_front @ Pose2D(-0.5, 0.3, 0.0)
    stand = edge.corrected(COUNTER, on_map)
    assert stand.distance_to(wanted) < 0.005
    assert stand.theta == pytest.approx(wanted.theta, abs=math.radians(0.3))


def test_too_few_hits_on_a_front_give_no_edge() -> None:
    assert front_edge(COUNTER, hits(0.0, 0.0, width=0.1)) is None
    assert front_edge(COUNTER, hits(0.5, 0.0)) is None


def test_hits_beyond_the_gate_on_either_side_or_at_the_ends_do_not_count() -> None:
    front = COUNTER.pose @ Pose2D(-COUNTER.footprint[0] / 2, 0.0, 0.0)
    along = np.linspace(-0.7, 0.7, 60)
    seen = np.column_stack([np.zeros(60), along])
    for beside in (
        np.column_stack([np.full(200, 0.09), np.linspace(-0.7, 0.7, 200)]),
        np.column_stack([np.full(200, -0.09), np.linspace(-0.7, 0.7, 200)]),
        np.column_stack([np.full(200, 0.05), np.linspace(0.775, 0.82, 200)]),
        np.column_stack([np.full(200, 0.05), np.linspace(-0.82, -0.775, 200)]),
    ):
        edge = front_edge(COUNTER, front.apply(np.vstack([seen, beside])))
        assert (edge.offset, edge.turn) == (pytest.approx(0.0, abs=1e-6), pytest.approx(0.0, abs=1e-6))
    short = np.column_stack([np.zeros(60), np.linspace(0.0, 0.19, 60)])
    assert front_edge(COUNTER, front.apply(short)) is None
    assert front_edge(COUNTER, front.apply(seen[::4])) is None
