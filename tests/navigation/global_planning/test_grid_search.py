from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.navigation.global_planning import grid_search
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc, shortest_length
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.global_planning.theta_star import theta_cells
from bestman_bt.world_model.semantic_map import SemanticMap

DIFFERENTIAL = Footprint(
    np.array(
        [
            [-0.28, -0.22],
            [-0.1, -0.26],
            [0.1, -0.26],
            [0.28, -0.22],
            [0.28, 0.22],
            [0.1, 0.26],
            [-0.1, 0.26],
            [-0.28, 0.22],
        ]
    )
)


def wall(x: float, y: float, to_y: float) -> list[tuple[float, float, float, float]]:
    """The faces of a wall of 10 cm along y."""
    a, b = x - 0.05, x + 0.05
    return [(a, y, a, to_y), (b, y, b, to_y), (a, y, b, y), (a, to_y, b, to_y)]


def rooms(width: float, doors: list[float], doorway: float = 0.9) -> SemanticMap:
    """Rooms of 4 m one beside the other, with a doorway in each wall at the heights ``doors``."""
    length = 4.0 * (len(doors) + 1)
    faces = [(0.0, 0.0, length, 0.0), (length, 0.0, length, width), (length, width, 0.0, width), (0.0, width, 0.0, 0.0)]
    for number, y in enumerate(doors, start=1):
        faces += wall(4.0 * number, 0.0, y - doorway / 2) + wall(4.0 * number, y + doorway / 2, width)
    return SemanticMap(np.array(faces, dtype=float), {})


@pytest.fixture(scope="module")
def large() -> Costmap:
    return Costmap.from_map(rooms(19.0, [2.0, 17.0, 9.0, 15.5]), DIFFERENTIAL)


def cost_of(cells: np.ndarray, costmap: Costmap, lethal: float) -> float:
    cost = costmap.cost(costmap.distance_at(cells), lethal)
    lengths = np.linalg.norm(np.diff(cells, axis=0), axis=1)
    return float(np.sum(lengths * (cost[1:] + cost[:-1]) / 2))


def test_the_way_in_the_corridor_costs_hardly_more_than_the_cheapest(
    large: Costmap, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert large.distance.size > 150_000
    for start, goal in (((1.0, 1.0), (19.0, 18.0)), ((1.0, 18.0), (18.5, 0.9)), ((7.0, 9.0), (13.0, 3.0))):
        found = []
        for least in (grid_search.LARGE, 10**9):
            monkeypatch.setattr(grid_search, "LARGE", least)
            cells = grid_search.cheapest_path(np.array(start), np.array(goal), large, 0.376)
            assert cells is not None
            found.append(cost_of(cells, large, 0.376))
            monkeypatch.undo()
        assert found[1] - 1e-9 <= found[0] <= 1.03 * found[1]


def test_the_shortest_length_is_that_of_the_steps_over_the_grid() -> None:
    costmap = Costmap.from_map(rooms(5.0, [2.5]), DIFFERENTIAL)
    straight = shortest_length(np.array([1.0, 2.5]), np.array([7.0, 2.5]), costmap, 0.26)
    assert straight == pytest.approx(6.0, abs=0.03)
    round_the_corner = shortest_length(np.array([1.0, 4.0]), np.array([7.0, 4.0]), costmap, 0.26)
    assert 6.0 + 1.0 < round_the_corner < 6.0 * math.sqrt(2.0)


def test_there_is_no_length_where_nothing_leads() -> None:
    costmap = Costmap.from_map(rooms(5.0, [2.5], doorway=0.5), DIFFERENTIAL)
    assert shortest_length(np.array([1.0, 2.5]), np.array([7.0, 2.5]), costmap, 0.26) == math.inf
    areas = areas_of_disc(costmap, 0.26)
    left, right = (int(areas[costmap.cells([x, 2.5])]) for x in (1.0, 7.0))
    assert 0 not in (left, right)
    assert left != right


@pytest.mark.parametrize("shift", np.linspace(0.0, 0.05, 6))
def test_a_doorway_of_80_cm_is_passed_wherever_it_lies_on_the_grid(shift: float) -> None:
    costmap = Costmap.from_map(rooms(5.0, [2.5 + shift], doorway=0.8), DIFFERENTIAL)
    cells = grid_search.cheapest_path(np.array([1.0, 4.0]), np.array([7.0, 1.0]), costmap, 0.3761, slack=0.01)
    assert cells is not None
    assert costmap.distance_at(cells).min() > 0.3561
    path = GridAStar().plan(Pose2D(1.0, 4.0, 0.0), Pose2D(7.0, 1.0, 0.0), costmap)
    assert isinstance(path, Path2D)
    assert costmap.distance_at(path.points).min() > 0.3561


@pytest.mark.parametrize("flips", [(False, False), (True, False), (False, True), (True, True)])
def test_no_straight_piece_crosses_what_nothing_may_cross(flips: tuple[bool, bool]) -> None:
    """Whichever way it goes up or down: rows and columns of random obstacles, mirrored."""
    rng = np.random.default_rng(4)
    cost = np.ones((40, 60))
    cost[rng.random(cost.shape) < 0.12] = math.inf
    cost[[0, -1]] = cost[:, [0, -1]] = math.inf
    ends = [np.array([3, 3]), np.array([30, 56])]
    for end in ends:
        cost[end[0] - 1 : end[0] + 2, end[1] - 1 : end[1] + 2] = 1.0
    for axis, flipped in enumerate(flips):
        if flipped:
            cost = np.flip(cost, axis)
            ends = [np.where(np.arange(2) == axis, cost.shape[axis] - 1 - end, end) for end in ends]
    cells = theta_cells(np.ascontiguousarray(cost), tuple(ends[0].tolist()), tuple(ends[1].tolist()))
    assert cells is not None
    for begin, end in pairwise(cells):
        steps = int(np.abs(end - begin).max())
        passed = np.floor(begin + (end - begin) * (np.arange(steps + 1) / steps)[:, None] + 0.5).astype(int)
        assert np.isfinite(cost[tuple(passed.T)]).all()
