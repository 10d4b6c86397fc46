"""Motions of the base that are halted, take too long or are changed on the way: nothing goes on that nobody wants."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import LaserScan, MotionErrorCode, Path2D, Pose2D
from bestman_bt.navigation.localization.front_edge import FrontEdge
from bestman_bt.world_model.world_model import BasePose
from tests.behaviours.scripted import UNDER_WAY, codes, load, run, scripted_skills


@pytest.fixture
def skills() -> Any:
    skills = scripted_skills("navigate_kitchen")
    skills.known_costmap = skills.seen_costmap = lambda: None
    return skills


MOTIONS = [
    ('DriveOnHeading dist_to_travel="0.5" speed="0.1"', ("drive", 0.5, 0.1)),
    ('DriveOnHeading dist_to_travel="-0.5" speed="-0.1"', ("drive", -0.5, 0.1)),
    ('BackUp backup_dist="0.5" backup_speed="0.1"', ("drive", -0.5, 0.1)),
    ('BackUp backup_dist="-0.5" backup_speed="-0.1"', ("drive", -0.5, 0.1)),
    ('Spin spin_dist="1"', ("turn", 1.0)),
    ('Spin spin_dist="-1"', ("turn", -1.0)),
]


@pytest.mark.parametrize(("leaf", "asked"), MOTIONS)
def test_a_motion_is_asked_for_once_and_halted_it_is_cancelled_and_the_next_time_begun_anew(
    skills: Any, leaf: str, asked: tuple[Any, ...]
) -> None:
    skills.base.ends[asked[0]] = [UNDER_WAY]
    tree = load(skills, f"<{leaf}/>")
    assert run(skills, tree, 5) == RUNNING
    assert skills.base.asked == [asked]
    tree.halt()
    assert skills.base.under_way == []
    assert run(skills, tree) == SUCCESS
    assert skills.base.asked == [asked, asked]


@pytest.mark.parametrize(("leaf", "asked"), MOTIONS)
def test_a_motion_that_takes_longer_than_it_may_is_cancelled(skills: Any, leaf: str, asked: tuple[Any, ...]) -> None:
    skills.base.ends[asked[0]] = [UNDER_WAY]
    begin = skills.clock.now()
    assert run(skills, load(skills, f'<{leaf} time_allowance="2"/>')) == FAILURE
    assert codes(skills) == ["timeout"]
    assert skills.clock.now() - begin == pytest.approx(2.0, abs=0.06)
    assert skills.base.under_way == []


def test_without_an_allowance_a_motion_takes_as_long_as_it_takes(skills: Any) -> None:
    skills.base.ends["drive"] = [UNDER_WAY]
    tree = load(skills, '<BackUp time_allowance="0"/>')
    assert run(skills, tree, 1000) == RUNNING
    skills.base.handles[0].succeed()
    assert run(skills, tree) == SUCCESS


def test_a_long_turn_is_made_of_quarters_and_its_time_counts_for_all_of_them(skills: Any) -> None:
    assert run(skills, load(skills, '<Spin spin_dist="-4"/>')) == SUCCESS
    assert [turn for _, turn in skills.base.asked] == pytest.approx([-math.pi / 2] * 2 + [math.pi - 4.0])
    skills.base.ends["turn"] = [UNDER_WAY, UNDER_WAY]
    tree = load(skills, '<Spin spin_dist="4" time_allowance="2"/>')
    assert run(skills, tree, 30) == RUNNING
    skills.base.handles[-1].succeed()
    assert run(skills, tree, 30) == FAILURE
    assert codes(skills) == ["timeout"]


def path_to(x: float, theta: float = 0.0) -> Path2D:
    return Path2D(np.array([[0.0, 0.0], [x, 0.0]]), Pose2D(x, 0.0, theta))


FOLLOW = '<FollowPath path="{path}" controller_id="{controller}"/>'


def test_another_path_is_gone_over_to_and_a_halt_cancels_the_drive_along_it(skills: Any) -> None:
    skills.base.ends["follow"] = [UNDER_WAY] * 3
    tree = load(skills, FOLLOW, path=path_to(2.0))
    assert run(skills, tree, 3) == RUNNING
    tree.blackboard.set("path", path_to(2.0))  # the same again
    assert run(skills, tree, 3) == RUNNING
    assert len(skills.base.handles) == 1
    second = path_to(2.0, theta=1.0)
    tree.blackboard.set("path", second)
    assert run(skills, tree, 3) == RUNNING
    assert [path for _, path, *_ in skills.base.asked][1:] == [second]
    tree.blackboard.set("path", None)  # cleared: it goes on along the one that it has
    assert run(skills, tree, 3) == RUNNING
    tree.halt()
    assert skills.base.handles[-1].done
    assert skills.base.handles[-1].failure.code is MotionErrorCode.CANCELED


def test_the_drive_along_the_last_path_decides(skills: Any) -> None:
    for end, status in ((None, SUCCESS), (MotionErrorCode.BLOCKED, FAILURE)):
        skills.base.ends["follow"] = [UNDER_WAY, UNDER_WAY]
        tree = load(skills, FOLLOW, path=path_to(2.0))
        assert run(skills, tree, 3) == RUNNING
        tree.blackboard.set("path", path_to(3.0))
        assert run(skills, tree, 3) == RUNNING
        skills.base.handles[-2].abort(MotionErrorCode.SUPERSEDED, "a newer command")
        assert run(skills, tree, 3) == RUNNING
        if end is None:
            skills.base.handles[-1].succeed()
        else:
            skills.base.handles[-1].fail(end, "something is in the way")
        assert run(skills, tree, 3) == status
    assert codes(skills) == ["blocked"]


def test_the_follower_is_chosen_by_name_and_can_change_during_a_drive(skills: Any) -> None:
    skills.followers = lambda name, folders: f"follower {name}"
    skills.base.ends["follow"] = [UNDER_WAY, UNDER_WAY]
    tree = load(skills, FOLLOW, path=path_to(2.0), controller="")
    assert run(skills, tree, 2) == RUNNING
    tree.blackboard.set("controller", "pure_pursuit")
    assert run(skills, tree, 2) == RUNNING
    assert [follower for *_, follower in skills.base.asked] == [None, "follower pure_pursuit"]


def test_without_a_path_nothing_is_driven(skills: Any) -> None:
    assert run(skills, load(skills, FOLLOW)) == FAILURE
    assert codes(skills) == ["no_path"]
    assert skills.base.asked == []


GOAL = Pose2D(0.5, 0.8, 2.2)


def test_a_base_straight_before_its_staging_pose_backs_up_to_it_and_drives_what_is_left_of_the_way(skills: Any) -> None:
    """The goal is 0.5 m ahead of staging; the base stands 0.3 m before that, and comes to rest 5 cm short."""
    skills.world.base = BasePose(GOAL @ Pose2D(-0.2, 0.01, 0.02), 0.01, 0.01, 0.0)
    follow = skills.base._begin

    def begin(name: str, *arguments: Any) -> Any:
        ends = {
            "follow": Pose2D(-0.05, 0.002, 0.05),
            "drive": Pose2D(0.0, 0.002, 0.05),
            "rotate_to": Pose2D(0, 0.002, 0),
        }
        if name != "drive" or len(skills.base.asked):
            skills.world.base = BasePose(GOAL @ ends[name], 0.01, 0.01, 0.0)
        return follow(name, *arguments)

    skills.base._begin = begin
    tree = load(skills, '<DockAt goal="{goal}" docked="{docked}"/>', goal=GOAL)
    assert run(skills, tree) == SUCCESS
    names = [name for name, *_ in skills.base.asked]
    assert names == ["drive", "follow", "drive", "rotate_to"]
    assert skills.base.asked[0][1] == pytest.approx(-0.3)
    _, path, costmap, _ = skills.base.asked[1]
    assert costmap is None
    np.testing.assert_allclose(path.points[-1], GOAL.xy)
    np.testing.assert_allclose(path.points[1], (GOAL @ Pose2D(-0.25, 0.0, 0.0)).xy)
    assert skills.base.asked[2][1] == pytest.approx(0.05)
    assert skills.base.asked[3][1] == GOAL.theta
    assert tree.blackboard.get("docked") == GOAL


@pytest.mark.parametrize(
    ("stands", "first"),
    [
        ((-0.2, 0.0, 0.08), ("drive", pytest.approx(-0.3))),  # the staging pose is at -0.5
        ((-0.2, 0.0, -0.1), ("follow",)),  # turned by 5.7 degrees
        ((-0.2, 0.06, 0.0), ("follow",)),
        ((-0.8, 0.0, 0.0), ("follow",)),
    ],
)
def test_only_a_base_straight_before_its_staging_pose_backs_up_to_it(
    skills: Any, stands: tuple[float, float, float], first: tuple[Any, ...]
) -> None:
    skills.world.base = BasePose(GOAL @ Pose2D(*stands), 0.01, 0.01, 0.0)
    skills.global_planning = SimpleNamespace(plan=lambda *_: path_to(1.0))
    skills.base.ends[first[0]] = [MotionErrorCode.BLOCKED]
    assert run(skills, load(skills, '<DockAt goal="{goal}"/>', goal=GOAL)) == FAILURE
    assert [asked[: len(first)] for asked in skills.base.asked] == [first]


def test_a_base_that_stays_beside_its_goal_tries_as_often_as_it_may_and_reports_how_far_it_is_off(skills: Any) -> None:
    skills.world.base = BasePose(GOAL @ Pose2D(-0.5, 0.0, 0.0), 0.01, 0.01, 0.0)
    skills.base.ends["follow"] = [MotionErrorCode.TOLERANCE] * 9
    plan = path_to(1.0)
    skills.global_planning = SimpleNamespace(plan=lambda *_: plan)
    assert run(skills, load(skills, '<DockAt goal="{goal}" attempts="2"/>', goal=GOAL)) == FAILURE
    assert codes(skills) == ["not_docked"]
    assert "after 2 approaches" in skills.failures[-1].why
    skills.base.ends["follow"] = [MotionErrorCode.BLOCKED]
    assert run(skills, load(skills, '<DockAt goal="{goal}" attempts="2"/>', goal=GOAL)) == FAILURE
    assert codes(skills)[-1] == "blocked"


def test_each_approach_is_corrected_by_the_front_from_the_goal_that_was_asked(
    skills: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    piece = skills.world.map.furniture["counter"]
    monkeypatch.setattr(
        "bestman_bt.navigation.localization.front_edge.front_edge", lambda *_: FrontEdge(0.01, 0.004, 0.001)
    )
    skills.base.lidar = SimpleNamespace(base_from_lidar=Pose2D())
    scan = LaserScan(np.full(4, np.inf), 0.0, 0.1, 0.1, 8.0, 0.0)
    skills.base.scan = lambda: SimpleNamespace(scan=scan)
    skills.world.base = BasePose(GOAL @ Pose2D(-0.5, 0.0, 0.0), 0.01, 0.01, 0.0)
    skills.base.ends["follow"] = [MotionErrorCode.TOLERANCE] * 9
    assert run(skills, load(skills, '<DockAt goal="{goal}" furniture="counter" attempts="3"/>', goal=GOAL)) == FAILURE
    goals = [path.goal for name, path, *_ in skills.base.asked if name == "follow"]
    assert goals == [FrontEdge(0.01, 0.004, 0.001).corrected(piece, GOAL)] * 3


@pytest.mark.parametrize("speed", [(0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.3, 0.4), (9.0, 0.0)])
def test_the_rate_of_a_child_goes_with_the_speed_whichever_way_the_base_drives(
    skills: Any, speed: tuple[float, float]
) -> None:
    """From 1 Hz at rest to 2 Hz at 0.5 m/s."""
    body = """<PipelineSequence>
      <SpeedController min_rate="1" max_rate="2" max_speed="0.5"><Script code="n := n + 1"/></SpeedController>
      <Wait wait_duration="99"/>
    </PipelineSequence>"""
    skills.base.velocity = lambda: SimpleNamespace(vx=speed[0], vy=speed[1])
    tree = load(skills, body, n=0)
    run(skills, tree, 20)
    before = tree.blackboard.get("n")
    run(skills, tree, 400)
    rate = 1.0 + min(1.0, math.hypot(*speed) / 0.5)
    assert (tree.blackboard.get("n") - before) / 20.0 == pytest.approx(rate, abs=0.25)
    tree.halt()
    before = tree.blackboard.get("n")
    run(skills, tree, 1)
    assert tree.blackboard.get("n") == before + 1, "restarted, it is due at once"


def test_a_distance_counts_from_where_the_child_has_last_succeeded(skills: Any) -> None:
    body = """<PipelineSequence>
      <DistanceController distance="0.5"><Sequence><Script code="n := n + 1"/><ScriptCondition code="fine"/></Sequence>
      </DistanceController><Wait wait_duration="99"/></PipelineSequence>"""
    tree = load(skills, body, n=0, fine=True)
    counts = []
    for x in (0.0, 0.3, 0.6, 0.9, 1.2):
        skills.world.base = BasePose(Pose2D(x, -x, 0.0), 0.01, 0.01, 0.0)  # 1.41 times as far as the crow flies
        run(skills, tree, 1)
        counts.append(tree.blackboard.get("n"))
    assert counts == [1, 1, 2, 2, 3]
    tree.halt()
    run(skills, tree, 1)
    assert tree.blackboard.get("n") == 4


@pytest.mark.parametrize("code", [MotionErrorCode.STOPPED, MotionErrorCode.SUPERSEDED])
@pytest.mark.parametrize(("leaf", "asked"), MOTIONS[:1] + MOTIONS[-1:])
def test_a_motion_that_was_stopped_or_taken_over_by_another_command_has_failed(
    skills: Any, leaf: str, asked: tuple[Any, ...], code: MotionErrorCode
) -> None:
    skills.base.ends[asked[0]] = [UNDER_WAY]
    tree = load(skills, f"<{leaf}/>")
    assert run(skills, tree, 3) == RUNNING
    skills.base.handles[-1].abort(code, "it was ended from outside")
    assert run(skills, tree, 3) == FAILURE
    assert codes(skills) == [code.value]


def test_a_follower_that_nobody_knows_given_on_the_way_ends_the_drive_too(skills: Any) -> None:
    skills.followers = lambda name, folders: f"follower {name}"
    skills.base.ends["follow"] = [UNDER_WAY]
    tree = load(skills, FOLLOW, path=path_to(2.0), controller="")
    assert run(skills, tree, 2) == RUNNING
    tree.blackboard.set("controller", "nobody")
    assert run(skills, tree, 2) == FAILURE
    assert codes(skills) == ["bad_input"]
    assert skills.base.under_way == []


def test_a_speed_controller_that_is_started_again_for_the_same_goal_ticks_its_child_at_once(skills: Any) -> None:
    skills.base.velocity = lambda: SimpleNamespace(vx=0.0, vy=0.0)
    counting = '<SpeedController min_rate="0.1" max_rate="0.2"><Script code="n := n + 1"/></SpeedController>'
    tree = load(skills, f'<PipelineSequence>{counting}<Wait wait_duration="99"/></PipelineSequence>', n=0)
    for started in (1, 2):
        assert run(skills, tree, 20) == RUNNING
        assert tree.blackboard.get("n") == started
        tree.halt()


def test_after_a_halt_no_path_is_compared_with_one_from_before(skills: Any) -> None:
    body = """<PipelineSequence>
      <PathLongerOnApproach path="{path}"><Script code="n := n + 1"/></PathLongerOnApproach><Wait wait_duration="99"/>
    </PipelineSequence>"""
    tree = load(skills, body, n=0)
    noticed = []
    for metres, halts in ((1.0, False), (3.0, False), (1.0, False), (3.0, True)):
        if halts:
            tree.halt()
        tree.blackboard.set("path", Path2D(np.array([[-metres, 0.0], [0.0, 0.0]]), Pose2D()))
        assert run(skills, tree, 2) == RUNNING
        noticed.append(tree.blackboard.get("n"))
    assert noticed == [0, 1, 1, 1]
