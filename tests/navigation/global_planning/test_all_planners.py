"""What every global planner owes, on random rooms with random boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.messages import Box, Path2D, PlacedShape, Pose, Pose2D
from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar, HybridAStarSearch, SearchNode
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.global_planning.theta_star import ThetaStar
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import Obstacle
from examples.plugins.sampled_roads import PRM, RRTStar

PLANNERS = {
    "grid_astar": GridAStar(),
    "theta_star": ThetaStar(),
    "hybrid_astar": HybridAStar(),
    "prm": PRM(samples=400),
    "rrt_star": RRTStar(samples=300),
}
LONG = Footprint(np.array([[-0.4, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.4, 0.2]]))


def walls(*ends: tuple[float, float, float, float]) -> SemanticMap:
    return SemanticMap(np.array(ends, dtype=float), {})


def room(width: float, height: float) -> list[tuple[float, float, float, float]]:
    return [(0, 0, width, 0), (width, 0, width, height), (width, height, 0, height), (0, height, 0, 0)]


def two_rooms(doorway: float) -> SemanticMap:
    """6 by 4 m with a wall of 10 cm in the middle and a doorway in the middle of it."""
    low, high = 2.0 - doorway / 2, 2.0 + doorway / 2
    faces = [(x, *span) for x in (2.95, 3.05) for span in ((0.0, low), (high, 4.0))]
    edges = [(2.95, y, 3.05, y) for y in (low, high)]
    return walls(*room(6.0, 4.0), *((x, a, x, b) for x, a, b in faces), *edges)


def cluttered(seed: int) -> tuple[Costmap, list[tuple[Pose2D, Pose2D]]]:
    """A room of 5 by 4 m with boxes, and two pairs of places where the base can turn that hang together."""
    rng = np.random.default_rng(seed)
    boxes = []
    for number in range(5):
        x, y, turn = rng.uniform((0.8, 0.8, 0.0), (4.2, 3.2, math.pi))
        size = (float(rng.uniform(0.1, 0.6)), float(rng.uniform(0.1, 0.6)), 0.5)
        pose = Pose.from_xyz_rpy((float(x), float(y), 0.25), (0.0, 0.0, float(turn)))
        boxes.append(Obstacle(f"box_{number}", (PlacedShape(Box(size), pose),), 0.0))
    costmap = Costmap.from_map(walls(*room(5.0, 4.0)), LONG, boxes)
    areas = areas_of_disc(costmap, LONG.circumscribed_radius + 0.05)
    points = costmap.grid_points(np.argwhere(areas > 0))
    inside = points[np.all((points > 0.0) & (points < (5.0, 4.0)), axis=1)]
    labels = areas[costmap.cells(inside)]
    points = inside[labels == np.bincount(labels).argmax()]
    chosen = points[rng.integers(len(points), size=4)]
    poses = [Pose2D(float(x), float(y), float(rng.uniform(-3, 3))) for x, y in chosen]
    return costmap, [(poses[0], poses[1]), (poses[2], poses[3])]


def swept(path: Path2D) -> np.ndarray:
    """Every place and heading that a base passes which turns at the corners, (N, 3)."""
    poses = []
    deltas = np.diff(path.points, axis=0)
    headings = np.arctan2(deltas[:, 1], deltas[:, 0]) + np.where(path.reverse, math.pi, 0.0)
    after = np.append(headings[1:], path.goal.theta)
    for begin, delta, heading, next_heading in zip(path.points, deltas, headings, after, strict=False):
        share = np.linspace(0.0, 1.0, max(2, int(np.linalg.norm(delta) / 0.01)))[:, None]
        poses.append(np.column_stack([begin + share * delta, np.full(len(share), heading)]))
        turn = (next_heading - heading + math.pi) % (2 * math.pi) - math.pi
        turned = heading + turn * np.linspace(0.0, 1.0, max(2, int(abs(turn) / 0.02)))
        poses.append(np.column_stack([np.broadcast_to(begin + delta, (len(turned), 2)), turned]))
    return np.vstack(poses)


@pytest.fixture(params=list(PLANNERS))
def planner(request: pytest.FixtureRequest) -> GlobalPlanner:
    return PLANNERS[request.param]


@pytest.mark.parametrize("seed", range(4))
def test_a_path_through_clutter_leads_from_start_to_goal_and_touches_nothing(planner: GlobalPlanner, seed: int) -> None:
    costmap, problems = cluttered(seed)
    for start, goal in problems:
        path = planner.plan(start, goal, costmap)
        assert isinstance(path, Path2D), path
        np.testing.assert_allclose(path.points[[0, -1]], [start.xy, goal.xy], atol=1e-9)
        assert path.goal == goal
        assert costmap.footprint_clearance(swept(path)).min() > 0.0


def test_a_base_passes_lengthwise_where_it_cannot_turn(planner: GlobalPlanner) -> None:
    costmap = Costmap.from_map(two_rooms(0.6), LONG)
    assert costmap.distance_at([3.0, 2.0]) < LONG.circumscribed_radius
    path = planner.plan(Pose2D(1.0, 1.0, 1.0), Pose2D(5.0, 1.2, -1.0), costmap)
    assert isinstance(path, Path2D), path
    poses = swept(path)
    assert costmap.footprint_clearance(poses).min() > 0.0
    in_doorway = poses[np.abs(poses[:, 0] - 3.0) < 0.05]
    assert np.abs(np.sin(in_doorway[:, 2])).max() < 0.5


def test_a_doorway_narrower_than_the_base_is_no_path(planner: GlobalPlanner) -> None:
    failure = planner.plan(Pose2D(1.0, 1.0, 1.0), Pose2D(5.0, 1.2, -1.0), Costmap.from_map(two_rooms(0.39), LONG))
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is PlanningFailureReason.NO_PATH
    assert "(1.00, 1.00) m to (5.00, 1.20) m" in failure.text


@pytest.mark.parametrize(
    ("start", "goal", "reason"),
    [
        (Pose2D(1.0, 1.0, 0.0), Pose2D(5.8, 2.0, 0.0), PlanningFailureReason.GOAL_BLOCKED),
        (Pose2D(1.0, 1.0, 0.0), Pose2D(3.0, 0.5, 0.0), PlanningFailureReason.GOAL_BLOCKED),
        (Pose2D(1.0, 1.0, 0.0), Pose2D(9.0, 2.0, 0.0), PlanningFailureReason.GOAL_OUTSIDE),
        (Pose2D(-3.0, 1.0, 0.0), Pose2D(1.0, 1.0, 0.0), PlanningFailureReason.START_OUTSIDE),
        (Pose2D(3.0, 0.5, 0.0), Pose2D(1.0, 1.0, 0.0), PlanningFailureReason.START_BLOCKED),
    ],
)
def test_what_cannot_be_planned_is_answered_with_the_reason(
    planner: GlobalPlanner, start: Pose2D, goal: Pose2D, reason: PlanningFailureReason
) -> None:
    failure = planner.plan(start, goal, Costmap.from_map(two_rooms(0.9), LONG))
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is reason
    assert failure.text


def test_a_stand_pose_before_a_wall_is_left_backwards_and_entered_straight(planner: GlobalPlanner) -> None:
    costmap = Costmap.from_map(two_rooms(0.9), LONG)
    at_wall, at_other_wall = Pose2D(5.56, 3.0, 0.0), Pose2D(0.44, 1.0, math.pi)
    path = planner.plan(at_wall, at_other_wall, costmap)
    assert isinstance(path, Path2D), path
    assert path.reverse[0]
    last = path.points[-1] - path.points[-2]
    assert math.atan2(last[1], -last[0]) == pytest.approx(0.0, abs=0.05)
    assert costmap.footprint_clearance(swept(path)).min() > 0.0


@pytest.mark.parametrize(("ends", "backwards"), [((-0.7, 0.3), False), ((-0.3, 0.7), True)])
def test_a_lane_is_left_by_its_nearer_end(ends: tuple[float, float], backwards: bool) -> None:
    left, right = (3.0 + end for end in ends)
    lane = [(left, y, right, y) for y in (1.7, 2.3)]
    costmap = Costmap.from_map(walls(*room(6.0, 4.0), *lane), LONG)
    path = ThetaStar().plan(Pose2D(3.0, 2.0, 0.0), Pose2D(3.0, 3.3, 0.0), costmap)
    assert isinstance(path, Path2D)
    assert bool(path.reverse[0]) is backwards


def test_a_base_inside_a_margin_may_drive_out_of_it(planner: GlobalPlanner) -> None:
    crate = Obstacle("crate", (PlacedShape(Box((0.6, 0.6, 0.6)), Pose.from_xyz_rpy((5.5, 3.0, 0.3))),), 0.0)
    costmap = Costmap.from_map(two_rooms(0.9), LONG, [crate])
    too_close = Pose2D(5.2 - 0.4 + 0.02, 3.0, 0.0)
    assert costmap.clearance_at(too_close) < 0.0
    assert isinstance(planner.plan(too_close, Pose2D(1.0, 1.0, 0.0), costmap), Path2D)


def test_equal_questions_have_equal_answers(planner: GlobalPlanner) -> None:
    costmap, ((start, goal), _) = cluttered(7)
    first, second = (planner.plan(start, goal, costmap) for _ in range(2))
    assert isinstance(first, Path2D)
    assert isinstance(second, Path2D)
    np.testing.assert_array_equal(first.points, second.points)
    np.testing.assert_array_equal(first.reverse, second.reverse)


@pytest.mark.parametrize("radius", [0.3, 0.8])
def test_hybrid_astar_keeps_to_its_turning_radius(radius: float) -> None:
    costmap = Costmap.from_map(walls(*room(7.0, 6.0)), LONG)
    path = HybridAStar(turning_radius=radius).plan(Pose2D(1.5, 1.5, 0.0), Pose2D(2.2, 4.0, math.pi), costmap)
    assert isinstance(path, Path2D)
    deltas = np.diff(path.points, axis=0)
    headings = np.arctan2(deltas[:, 1], deltas[:, 0]) + np.where(path.reverse, math.pi, 0.0)
    turns = np.abs((np.diff(headings) + math.pi) % (2 * math.pi) - math.pi)
    steps = np.linalg.norm(deltas, axis=1)
    same_direction = (path.reverse[1:] == path.reverse[:-1]) & (np.minimum(steps[1:], steps[:-1]) > 0.01)
    curvature = turns[same_direction] / ((steps[1:] + steps[:-1]) / 2)[same_direction]
    assert curvature.max() < 1.1 / radius
    assert curvature.max() > 0.8 / radius


def test_a_way_back_and_a_change_of_direction_cost_what_they_are_worth() -> None:
    costmap = Costmap.from_map(walls(*room(7.0, 6.0)), LONG)
    planner = HybridAStar(branch=0.2, reverse_cost=3.0, switch_cost=0.7)
    search = HybridAStarSearch(costmap, np.array([5.0, 4.0, 0.0]), planner)
    start = SearchNode(np.array([[3.5, 3.0, 0.5]]), False, 0.0)
    ahead = search.successors(start)[1]
    for node, cost in zip(search.successors(ahead), [0.2] * 3 + [0.6 + 0.7] * 3, strict=True):
        free = float(costmap.cost(costmap.distance_at(node.poses[:, :2]), LONG.inscribed_radius).mean())
        driven = cost if cost < 0.5 else 0.6
        assert node.cost - ahead.cost == pytest.approx(free * driven + cost - driven, rel=0.02), node.backwards


@pytest.mark.parametrize("heading", [0.0, math.pi])
def test_a_hallway_in_which_the_base_cannot_turn_is_driven_straight_on(planner: GlobalPlanner, heading: float) -> None:
    costmap = Costmap.from_map(walls(*room(9.0, 0.62)), LONG)
    path = planner.plan(Pose2D(1.0, 0.31, heading), Pose2D(8.0, 0.31, heading), costmap)
    assert isinstance(path, Path2D), path
    assert costmap.footprint_clearance(swept(path)).min() > 0.0
    assert path.length < 7.1


def test_no_path_is_reported_if_the_base_would_have_to_turn_in_a_narrow_hallway(planner: GlobalPlanner) -> None:
    costmap = Costmap.from_map(walls(*room(4.0, 0.62)), LONG)
    failure = planner.plan(Pose2D(1.0, 0.31, 0.0), Pose2D(3.0, 0.31, math.pi), costmap)
    assert isinstance(failure, PlanningFailure)
    assert failure.reason is PlanningFailureReason.NO_PATH


def test_curves_change_direction_no_oftener_than_they_must() -> None:
    for seed in (0, 3, 29, 33):
        costmap, problems = cluttered(seed)
        for start, goal in problems:
            path = PLANNERS["hybrid_astar"].plan(start, goal, costmap)
            assert isinstance(path, Path2D)
            assert np.count_nonzero(np.diff(path.reverse.astype(int))) <= 4
