"""NavigateTo on a base that a test drives: other paths, waiting, recoveries, and halts in the middle of each."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import MotionErrorCode, Path2D, Pose2D
from bestman_bt.navigation.global_planning.base import PlanningFailure, PlanningFailureReason
from tests.behaviours.scripted import ASKEW, UNDER_WAY, codes, load, map_from, run, scripted_skills

GOAL = Pose2D(3.0, 0.0, 0.0)
BLOCKED = MotionErrorCode.BLOCKED
NO_PATH = PlanningFailure(PlanningFailureReason.NO_PATH, "there is no way")
KNOWN, SEEN = "the map", "the map and what the lidar sees"
PLANNING = 0.3
BACK_UP, PAUSE, PEOPLE = 0.8, 2.0, 3
WAIT_FOR_SHORT, WAIT_FOR_ANY = 5.0, 8.0


def path_of(length: float) -> Path2D:
    return Path2D(np.array([[3.0 - length, 0.0], [3.0, 0.0]]), GOAL)


class Behind:
    """Free for so many metres behind the base, but for ``taken`` metres behind it, and nowhere else."""

    def __init__(self, metres: float, taken: float = np.inf) -> None:
        self._metres, self._taken = metres, taken

    def footprint_clearance(self, poses: np.ndarray) -> np.ndarray:
        away = np.linalg.norm(poses[:, :2] - ASKEW.xy, axis=1)
        straight = [map_from(ASKEW, -metres, 0.0, 0.0)[:2] for metres in away]
        beside = np.linalg.norm(poses[:, :2] - straight, axis=1) + abs(poses[:, 2] - ASKEW.theta)
        free = (away < self._metres + 1e-6) & (np.abs(away - self._taken) > 0.01)
        return np.where((beside < 1e-6) & free, 1.0, -1.0)


@pytest.fixture
def skills() -> Any:
    """Planning takes 0.3 s and finds 2 m; nothing is in the way, and there is room behind."""
    skills = scripted_skills("navigate_kitchen")
    skills.costs["global_planning"] = PLANNING
    skills.plans, skills.planned_on = [], []
    skills.cleared = []

    def plan(start: Pose2D, goal: Pose2D, costmap: Any) -> Any:
        assert (start, goal) == (ASKEW, GOAL)
        skills.planned_on.append(costmap)
        return skills.plans.pop(0) if skills.plans else path_of(2.0)

    skills.global_planning = SimpleNamespace(plan=plan)
    skills.known_costmap, skills.seen_costmap = lambda: KNOWN, lambda: Behind(9.0)
    skills.base.layer = SimpleNamespace(
        on=lambda costmap: SEEN if costmap == KNOWN else costmap,
        moving=SimpleNamespace(obstacles=[]),
        clear=lambda: skills.cleared.append(1),
    )
    skills.base.blocked_at, skills.base.remaining = lambda: None, 2.0
    return skills


def to_goal(skills: Any, replans: int = 5) -> Any:
    return load(skills, '<NavigateTo goal="{goal}" max_replans="{replans}" path="{path}"/>', goal=GOAL, replans=replans)


def commands(skills: Any) -> list[str]:
    return [name for name, *_ in skills.base.asked]


def test_it_plans_around_what_is_seen_and_drives_along_that(skills: Any) -> None:
    tree = to_goal(skills)
    assert run(skills, tree) == SUCCESS
    assert skills.planned_on == [SEEN]
    assert commands(skills) == ["follow"]
    assert skills.base.asked[0][2] == KNOWN
    assert tree.blackboard.get("path").length == 2.0


def test_halted_on_the_way_the_drive_is_cancelled_and_the_next_time_begun_anew(skills: Any) -> None:
    skills.base.ends["follow"] = [UNDER_WAY]
    tree = to_goal(skills)
    assert run(skills, tree, 30) == RUNNING
    assert len(skills.base.under_way) == 1
    tree.halt()
    assert skills.base.under_way == []
    assert run(skills, tree) == SUCCESS
    assert commands(skills) == ["follow", "follow"]


def test_halted_while_another_path_is_planned_the_drive_is_cancelled_too(skills: Any) -> None:
    skills.base.ends["follow"] = [UNDER_WAY]
    tree = to_goal(skills)
    assert run(skills, tree, 10) == RUNNING
    skills.base.blocked_at = lambda: (3.0, None)
    skills.costs["global_planning"] = 30.0
    assert run(skills, tree, 20) == RUNNING
    assert len(skills.planned_on) == 2
    tree.halt()
    assert skills.base.under_way == []


@pytest.mark.parametrize(("longer", "taken"), [(1.4, True), (1.6, False)])
def test_a_path_that_is_hardly_longer_is_gone_over_to_without_a_stop(skills: Any, longer: float, taken: bool) -> None:
    skills.base.ends["follow"] = [UNDER_WAY, UNDER_WAY]
    tree = to_goal(skills)
    assert run(skills, tree, 10) == RUNNING
    contacts = iter([(3.0, None)])  # far enough away to go on for now
    skills.base.blocked_at = lambda: next(contacts, None)
    skills.plans = [path_of(2.0 + longer)]
    assert run(skills, tree, 20) == RUNNING
    assert commands(skills) == ["follow", "follow"] if taken else ["follow"]
    assert len(skills.base.under_way) == (2 if taken else 1), "what drives on is superseded, not cancelled"
    assert (tree.blackboard.get("path").length == 2.0) is not taken


@pytest.mark.parametrize(("ahead", "first"), [(1.9, ["park"]), (1.1, ["park", "drive"])])
def test_before_what_is_near_it_stops_and_before_what_came_suddenly_it_backs_up(
    skills: Any, ahead: float, first: list[str]
) -> None:
    skills.base.ends["follow"] = [UNDER_WAY, UNDER_WAY]
    tree = to_goal(skills)
    assert run(skills, tree, 10) == RUNNING
    skills.base.blocked_at = lambda: (ahead, None)
    skills.plans = [NO_PATH, NO_PATH]
    assert run(skills, tree, 14) == RUNNING
    assert commands(skills)[: 1 + len(first)] == ["follow", *first]
    if "drive" in first:
        assert skills.base.asked[2][1] == pytest.approx(-BACK_UP)


def test_it_waits_a_while_for_a_path_and_takes_a_long_one_then(skills: Any) -> None:
    skills.base.ends["follow"] = [UNDER_WAY, UNDER_WAY]
    tree = to_goal(skills)
    assert run(skills, tree, 10) == RUNNING
    skills.base.blocked_at = lambda: (1.5, None)
    skills.plans = [path_of(9.0)] * 99
    begin = skills.clock.now()
    while commands(skills).count("follow") < 2:
        assert run(skills, tree, 1) == RUNNING
        assert skills.clock.now() - begin < 20.0
    assert skills.clock.now() - begin == pytest.approx(WAIT_FOR_SHORT, abs=1.5)
    assert tree.blackboard.get("path").length == 9.0


def test_where_only_what_the_map_lacks_is_in_the_way_it_waits_and_reports_it_else_it_reports_why_at_once(
    skills: Any,
) -> None:
    skills.plans = [NO_PATH, path_of(2.0), *[NO_PATH] * 99]
    begin = skills.clock.now()
    assert run(skills, to_goal(skills, replans=0), 600) == FAILURE
    assert codes(skills) == ["path_blocked"]
    assert skills.clock.now() - begin == pytest.approx(WAIT_FOR_ANY, abs=1.5)
    assert skills.planned_on[:3] == [SEEN, KNOWN, SEEN]
    skills.plans, begin = [NO_PATH] * 9, skills.clock.now()
    assert run(skills, to_goal(skills, replans=0), 600) == FAILURE
    assert codes(skills)[-1] == "no_path"
    assert skills.clock.now() - begin < 1.0


@pytest.mark.parametrize("replans", [0, 1, 2])
def test_what_may_pass_is_tried_again_as_often_as_is_asked(skills: Any, replans: int) -> None:
    skills.base.ends["follow"] = [BLOCKED] * 99
    assert run(skills, to_goal(skills, replans), 2000) == FAILURE
    assert codes(skills) == ["blocked"]
    assert commands(skills).count("follow") == 1 + replans
    assert len(skills.cleared) == replans
    assert commands(skills).count("drive") == (replans + 1) // 2, "it backs up the first and every second time"
    assert run(skills, to_goal(skills, replans), 2000) == FAILURE, "the count begins anew"
    assert commands(skills).count("follow") == 2 * (1 + replans)


def test_where_somebody_walks_about_it_is_tried_three_times_as_often(skills: Any) -> None:
    skills.base.layer.moving.obstacles = ["somebody"]
    skills.base.ends["follow"] = [BLOCKED] * 99
    assert run(skills, to_goal(skills, 1), 3000) == FAILURE
    assert commands(skills).count("follow") == 1 + PEOPLE


def test_somebody_who_has_gone_does_not_excuse_what_blocks_the_way_after_that(skills: Any) -> None:
    skills.base.layer.moving.obstacles = ["somebody"]
    skills.base.layer.clear = skills.base.layer.moving.obstacles.clear  # by the first recovery
    skills.base.ends["follow"] = [BLOCKED] * 99
    assert run(skills, to_goal(skills, 2), 3000) == FAILURE
    assert commands(skills).count("follow") == 1 + 2


@pytest.mark.parametrize("code", [MotionErrorCode.LOST, MotionErrorCode.STOPPED, MotionErrorCode.FAULT])
def test_what_does_not_pass_ends_it_at_once(skills: Any, code: MotionErrorCode) -> None:
    skills.base.ends["follow"] = [code]
    assert run(skills, to_goal(skills)) == FAILURE
    assert codes(skills) == [code.value]
    assert commands(skills) == ["follow"]


def test_a_recovery_gives_time_and_goes_on_where_it_fails_itself_unless_the_robot_was_stopped(skills: Any) -> None:
    for end, status, follows in ((BLOCKED, SUCCESS, 2), (MotionErrorCode.STOPPED, FAILURE, 1)):
        skills.base.asked.clear()
        skills.base.ends["follow"], skills.base.ends["drive"] = [BLOCKED], [end]
        begin = skills.clock.now()
        assert run(skills, to_goal(skills), 2000) == status
        assert commands(skills).count("follow") == follows
        assert skills.clock.now() - begin >= PAUSE
    assert codes(skills) == ["stopped"]


@pytest.mark.parametrize(
    ("room", "taken", "back"),
    [(0.52, np.inf, 0.5), (9.0, np.inf, 0.8), (0.04, np.inf, None), (9.0, 0.35, 0.3), (9.0, 0.05, None)],
)
def test_it_backs_up_straight_as_far_as_is_free_and_through_nothing(
    skills: Any, room: float, taken: float, back: float | None
) -> None:
    skills.seen_costmap = lambda: Behind(room, taken)
    skills.base.ends["follow"] = [BLOCKED]
    assert run(skills, to_goal(skills)) == SUCCESS
    drives = [-asked[1] for asked in skills.base.asked if asked[0] == "drive"]
    assert drives == ([] if back is None else [pytest.approx(back)])


@pytest.mark.parametrize(
    ("x", "turn", "status"),
    [(0.049, 0.099, SUCCESS), (-0.049, -0.099, SUCCESS), (0.051, 0.0, FAILURE), (0.0, -0.101, FAILURE)],
)
def test_the_base_is_at_a_pose_within_both_tolerances(skills: Any, x: float, turn: float, status: int) -> None:
    assert run(skills, load(skills, '<At goal="{goal}"/>', goal=ASKEW @ Pose2D(x, 0.0, turn))) == status
    full_turn = Pose2D(ASKEW.x, ASKEW.y, ASKEW.theta - 2 * np.pi)
    assert run(skills, load(skills, '<At goal="{goal}"/>', goal=full_turn)) == SUCCESS
