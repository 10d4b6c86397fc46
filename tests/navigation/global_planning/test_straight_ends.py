"""Where a straight piece before or behind furniture may end for a base that has to turn there."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.navigation.global_planning.base import PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.straight_ends import Ends, StraightEnds, StraightPieces
from bestman_bt.world_model.semantic_map import SemanticMap

LANE = SemanticMap(np.array([(0.0, y, 6.0, y) for y in (-0.6, 0.6)] + [(x, -0.6, x, 0.6) for x in (0.0, 6.0)]), {})
BASE = Footprint(np.array([[-0.4, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.4, 0.2]]))


@pytest.mark.parametrize(("slack", "there"), [(0.0, False), (0.004, False), (0.006, True)])
def test_where_there_is_a_little_less_room_to_turn_than_wanted_the_slack_is_taken(slack: float, there: bool) -> None:
    costmap = Costmap.from_map(LANE, BASE)
    most = float(costmap.for_turning.distance_at([(x, 0.0) for x in np.arange(1.0, 5.0, 0.02)]).max())
    ends = StraightEnds(costmap, StraightPieces(), turning_distance=most + 0.005, slack=slack)
    found = ends.between(Pose2D(1.0, 0.0, 0.0), Pose2D(5.0, 0.0, 0.0))
    if there:
        assert isinstance(found, Ends)
    else:
        assert isinstance(found, PlanningFailure)
        assert found.reason is PlanningFailureReason.START_BLOCKED


def test_where_there_is_all_the_room_that_is_wanted_it_is_preferred_to_the_slack() -> None:
    costmap = Costmap.from_map(LANE, BASE)
    room = costmap.for_turning
    wanted = float(room.distance_at([3.0, 0.0]))
    found = StraightEnds(costmap, StraightPieces(), turning_distance=wanted, slack=0.3).between(
        Pose2D(3.0, 0.0, 0.0), Pose2D(5.4, 0.0, 0.0)
    )
    assert isinstance(found, Ends)
    assert float(room.distance_at(found.approach)) >= wanted


def two_rooms(*across: float) -> StraightEnds:
    """Two wide rooms with a passage from x = 2 m to x = 4 m, in which walls stand across at ``across``."""
    outline = [(0.0, -1.5), (2.0, -1.5), (2.0, -0.5), (4.0, -0.5), (4.0, -1.5), (6.0, -1.5)]
    outline += [(x, -y) for x, y in reversed(outline)]
    walls = [(*a, *b) for a, b in zip(outline, outline[1:] + outline[:1], strict=True)]
    walls += [(x, -0.5, x, 0.5) for x in across]
    costmap = Costmap.from_map(SemanticMap(np.array(walls), {}), BASE)
    return StraightEnds(costmap, StraightPieces(max_straight=2.5), turning_distance=0.6)


@pytest.mark.parametrize(
    ("start", "goal", "reason"),
    [(1.0, 3.3, PlanningFailureReason.GOAL_BLOCKED), (3.3, 1.0, PlanningFailureReason.START_BLOCKED)],
)
def test_no_straight_end_goes_through_a_wall_to_the_room_behind_it(
    start: float, goal: float, reason: PlanningFailureReason
) -> None:
    poses = Pose2D(start, 0.0, 0.0), Pose2D(goal, 0.0, 0.0)
    assert isinstance(two_rooms().between(*poses), Ends)
    found = two_rooms(2.6, 3.9).between(*poses)
    assert isinstance(found, PlanningFailure)
    assert found.reason is reason


@pytest.mark.parametrize(("x", "backwards"), [(2.7, True), (3.3, False)])
def test_a_base_leaves_a_narrow_place_by_its_nearer_end(x: float, backwards: bool) -> None:
    found = two_rooms().between(Pose2D(x, 0.0, 0.0), Pose2D(5.0, 0.0, 0.0))
    assert isinstance(found, Ends)
    assert found.backwards == backwards
    assert abs(found.leave[0] - 3.0) > 1.0
