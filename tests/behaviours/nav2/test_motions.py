"""Spin, BackUp, DriveOnHeading and Wait move by as much as they are told, no faster and no longer."""

from __future__ import annotations

import math

import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import wrap_angle
from tests.behaviours.at_the_table import PERIOD, failures_of, fastest, tick, tree_of
from tests.behaviours.truth import succeeds, why_not


@pytest.mark.slow
@pytest.mark.parametrize("angle", [-1.57, 4.0])
def test_a_spin_turns_by_its_angle_on_the_spot(driver, angle) -> None:
    before = driver.skills.world.base.pose
    assert succeeds(driver, f'<Spin spin_dist="{angle}" time_allowance="30"/>')
    after = driver.skills.world.base.pose
    by_odometry = 0.02 + 0.02 * abs(angle)
    assert wrap_angle(after.theta - before.theta - angle) == pytest.approx(0.0, abs=by_odometry)
    assert after.distance_to(before) < 0.03
    assert succeeds(driver, f'<Spin spin_dist="{-angle}" time_allowance="30"/>')


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "moved"),
    [
        ('<DriveOnHeading dist_to_travel="0.3" speed="0.2"/>', 0.3),
        ('<BackUp backup_dist="0.3" backup_speed="0.15"/>', -0.3),
        ('<DriveOnHeading dist_to_travel="-0.2" speed="-0.15"/>', -0.2),
        ('<DriveOnHeading dist_to_travel="0.2" speed="0.15"/>', 0.2),
    ],
)
def test_driving_straight_goes_so_far_and_no_faster(driver, motion, moved) -> None:
    before, tree, speeds = driver.skills.world.base.pose, driver.load(tree_of(motion)), [0.0]
    while (status := tick(tree)) == RUNNING:
        speeds.append(abs(driver.skills.base.velocity().vx))
    off = before.inverse() @ driver.skills.world.base.pose
    assert status == SUCCESS
    assert off.x == pytest.approx(moved, abs=0.02)
    assert abs(off.y) < 0.02
    assert 0.1 < max(speeds) < 0.23


@pytest.mark.slow
def test_what_takes_longer_than_its_time_is_stopped_and_reported(driver) -> None:
    assert why_not(driver, '<Spin spin_dist="3.0" time_allowance="0.5"/>')[0] == "timeout"
    driver.robot.clock.sleep(1.0)
    assert fastest(driver) < 0.02


def test_a_halted_motion_leaves_nothing_moving(driver) -> None:
    tree = driver.load(tree_of('<Spin spin_dist="1.5"/>'))
    tick(tree, 15)
    assert fastest(driver) > 0.2
    tree.halt()
    driver.robot.clock.sleep(1.0)
    assert fastest(driver) < 0.02


def test_waiting_lets_so_much_time_pass(driver) -> None:
    begin = driver.robot.clock.now()
    assert succeeds(driver, '<Wait wait_duration="1.5"/>')
    assert driver.robot.clock.now() - begin == pytest.approx(1.5, abs=2 * PERIOD)


@pytest.mark.parametrize(
    ("leaf", "port", "value"),
    [
        ('DriveOnHeading speed="-0.1"', "dist_to_travel", 0.2),
        ("DriveOnHeading", "dist_to_travel", 0.0),
        ("Spin", "spin_dist", math.inf),
        ("BackUp", "backup_speed", 0.0),
        ("Wait", "wait_duration", -1.0),
    ],
)
def test_entries_out_of_range_are_bad_input(driver, leaf, port, value) -> None:
    tree = driver.load(tree_of(f'<{leaf} {port}="{{entry}}"/>'))
    tree.blackboard.set("entry", value)
    assert tick(tree) == FAILURE
    code, words = failures_of(driver)[0]
    assert code == "bad_input"
    assert port in words


@pytest.mark.slow
def test_a_wall_ends_a_drive_before_it_is_touched_and_the_base_counts_as_stuck(kitchen) -> None:
    session, _ = kitchen()
    tree = session.load(tree_of('<DriveOnHeading dist_to_travel="-3" speed="-0.3" time_allowance="60"/>'))
    stuck = []
    while tick(tree) == RUNNING:
        stuck.append(succeeds(session, "<IsStuck/>"))
    moving = len(stuck) // 2
    assert not any(stuck[:moving])
    assert stuck[-1]
    failure = [f for f in session.skills.failures if f.error_code != "not_stuck"][-1]
    assert failure.error_code == "blocked"
    assert succeeds(session, "<IsStuck/>")
    assert math.isfinite(session.skills.world.base.pose.x)
    assert succeeds(session, '<DriveOnHeading dist_to_travel="0.3" speed="0.2"/>')
    assert why_not(session, "<IsStuck/>")[0] == "not_stuck"
