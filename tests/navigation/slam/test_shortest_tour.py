from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from bestman_bt.navigation.slam.frontiers import shortest_tour


@pytest.mark.parametrize("seed", range(5))
def test_no_other_order_is_shorter(seed):
    points = np.random.default_rng(seed).uniform(0.0, 10.0, (7, 2))
    distances = np.linalg.norm(points[:, None] - points, axis=2)

    def length(order):
        return sum(distances[a, b] for a, b in itertools.pairwise([0, *order]))

    shortest = min(map(length, itertools.permutations(range(1, 7))))
    assert length(shortest_tour(distances)) == pytest.approx(shortest)


def test_what_cannot_be_got_to_comes_last():
    line = np.array([0.0, 3.0, 1.0, 2.0])
    distances = np.abs(line[:, None] - line)
    distances[:, 2] = distances[2, :] = math.inf
    assert shortest_tour(distances) == [3, 1, 2]


def test_nowhere_to_go_is_no_tour():
    assert shortest_tour(np.zeros((1, 1))) == []
