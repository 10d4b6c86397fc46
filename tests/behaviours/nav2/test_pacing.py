"""How often a child is ticked follows from how the base moves."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import Path2D, Pose2D
from tests.behaviours.at_the_table import PERIOD, tick, tree_of

pytestmark = pytest.mark.slow

COUNT = '<Script code="n := n + 1"/>'


def counting(session, decorator: str, beside: str = "<Wait wait_duration='99'/>"):
    tree = session.load(tree_of(f"<PipelineSequence>{decorator.format(COUNT)}{beside}</PipelineSequence>"))
    tree.blackboard.set("n", 0)
    return tree


def count_within(tree, seconds: float) -> int:
    before = tree.blackboard.get("n")
    assert tick(tree, round(seconds / PERIOD)) == RUNNING
    return int(tree.blackboard.get("n") - before)


def test_a_standing_base_asks_for_the_lowest_rate_and_a_driving_one_for_more(kitchen) -> None:
    session, _ = kitchen()
    decorator = '<SpeedController min_rate="0.5" max_rate="4" max_speed="0.5">{}</SpeedController>'
    tree = counting(session, decorator, '<FollowPath path="{path}"/>')
    tree.blackboard.set("path", Path2D(np.array([[-2.0, -0.3], [0.9, -0.3]]), Pose2D(0.9, -0.3, 0.0)))
    session.skills.base.speed_limit = 0.0
    assert count_within(tree, 2.0) <= 3  # at the start, after the first period at the highest rate, then every 2 s
    session.skills.base.speed_limit = None
    tick(tree, 70)
    assert session.skills.base.velocity().vx > 0.5
    assert count_within(tree, 1.0) >= 3
    tree.halt()
    assert count_within(tree, PERIOD) == 1


def test_a_goal_that_changes_is_due_at_once(driver) -> None:
    tree = counting(driver, '<SpeedController min_rate="0.1" max_rate="0.2">{}</SpeedController>')
    tree.blackboard.set("goal", Pose2D(1.0, 0.0, 0.0))
    assert count_within(tree, 1.0) == 1
    tree.blackboard.set("goal", Pose2D(2.0, 0.0, 0.0))
    assert count_within(tree, 1.0) == 1


def test_the_child_is_ticked_once_for_each_distance_driven(kitchen) -> None:
    session, _ = kitchen()
    tree = counting(
        session, '<DistanceController distance="0.5">{}</DistanceController>', '<FollowPath path="{path}"/>'
    )
    tree.blackboard.set("path", Path2D(np.array([[-2.0, -0.3], [-0.4, -0.3]]), Pose2D(-0.4, -0.3, 0.0)))
    assert tick(tree, 400) == SUCCESS
    assert tree.blackboard.get("n") == 4


def test_a_child_that_runs_is_ticked_to_its_end_and_halted_with_its_controller(driver) -> None:
    for name in ("SpeedController", "DistanceController"):
        tree = driver.load(tree_of(f"<{name}><Wait wait_duration='0.5' name='child'/></{name}>"))
        assert tick(tree, 5) == RUNNING
        assert tree.node("child").state == RUNNING
        tree.halt()
        assert tree.node("child").state != RUNNING
        assert tick(tree, 30) == SUCCESS


def path_of(length: float) -> Path2D:
    return Path2D(np.array([[3.0 - length, 0.0], [3.0, 0.0]]), Pose2D(3.0, 0.0, 0.0))


def test_a_path_that_became_much_longer_close_to_the_goal_is_noticed(driver) -> None:
    tree = driver.load(tree_of('<PathLongerOnApproach path="{path}"><AlwaysFailure/></PathLongerOnApproach>'))
    assert tick(tree) == SUCCESS
    for length, noticed in ((9.0, False), (20.0, False), (2.5, False), (4.9, False), (2.5, False), (5.1, True)):
        tree.blackboard.set("path", path_of(length))
        assert tick(tree) == (FAILURE if noticed else SUCCESS), length
    assert tick(tree) == SUCCESS
    other = Path2D(np.array([[0.0, 0.0], [9.0, 0.0]]), Pose2D(9.0, 0.0, 0.0))
    for path in (path_of(1.0), other):
        tree.blackboard.set("path", path)
        assert tick(tree) == SUCCESS
