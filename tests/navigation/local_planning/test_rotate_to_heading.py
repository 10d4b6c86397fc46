from __future__ import annotations

import math

import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading

DT = 0.025


def turned(creep: float, **parameters: float) -> tuple[Pose2D, list[Twist2D]]:
    """Where a half turn ends that pushes the base along itself by ``creep`` metres a radian, and what was commanded."""
    follower = RotateToHeading(**parameters)
    follower.turn_to(math.pi - 0.3)
    pose, velocity, commands = Pose2D(), Twist2D(), []
    for _ in range(400):
        command = follower.compute(pose, velocity, DT)
        commands.append(command.twist)
        if command.done:
            return pose, commands
        velocity = command.twist
        ahead = (velocity.vx + creep * abs(velocity.wz)) * DT
        pose = pose @ Pose2D(ahead, 0.0, velocity.wz * DT)
    raise AssertionError(f"still turning at {pose}")


@pytest.mark.parametrize("creep", [-0.17, 0.17])
def test_a_base_that_creeps_while_it_turns_is_driven_back(creep: float) -> None:
    left_alone, _ = turned(creep, slack=math.inf)
    held, commands = turned(creep)
    assert math.hypot(left_alone.x, left_alone.y) > 0.33
    assert math.hypot(held.x, held.y) < 0.125
    assert held.theta == pytest.approx(math.pi - 0.3, abs=0.01)
    assert max(abs(twist.vx) for twist in commands) <= RotateToHeading().max_place_speed


def test_a_base_that_turns_on_the_spot_is_commanded_to_turn_alone() -> None:
    _, commands = turned(0.01)
    assert not any(twist.vx for twist in commands)


def test_a_turn_is_over_when_the_base_has_come_to_rest_within_the_tolerance() -> None:
    for error, rate, done in ((0.004, 0.02, True), (-0.004, -0.02, True), (0.006, 0.0, False), (0.004, 0.04, False)):
        follower = RotateToHeading()
        follower.turn_to(2.0 + error)
        assert follower.compute(Pose2D(1.0, 1.0, 2.0), Twist2D(wz=rate), DT).done == done
    follower = RotateToHeading()
    follower.turn_to(2.0, speed=0.5)  # it is commanded to turn still
    command = follower.compute(Pose2D(0.0, 0.0, 2.0), Twist2D(), DT)
    assert not command.done
    assert command.twist.wz == pytest.approx(0.5 - 1.5 * DT)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_turns_the_shorter_way_within_its_limits_and_half_a_turn_away_as_it_turns_already(side: float) -> None:
    follower = RotateToHeading()
    follower.turn_to(-3.0 * side)
    pose, rates = Pose2D(0.0, 0.0, 2.5 * side), []
    for _ in range(200):
        command = follower.compute(pose, Twist2D(wz=rates[-1] if rates else 0.0), DT)
        if command.done:
            break
        rates.append(command.twist.wz)
        pose = pose @ Pose2D(0.0, 0.0, command.twist.wz * DT)
    assert command.done
    assert all(rate * side >= 0.0 for rate in rates)
    changes = [abs(after - before) for before, after in zip([0.0, *rates], rates, strict=False)]
    assert max(changes) <= 1.5 * DT + 1e-9
    for away, sign in ((3.1, 1.0), (2.8, -1.0)):
        follower.turn_to(0.0, speed=0.3 * side)
        rate = follower.compute(Pose2D(0.0, 0.0, away * side), Twist2D(), DT).twist.wz
        assert (rate - 0.3 * side) * side * sign > 0.0


def test_a_new_turn_holds_the_place_where_it_begins() -> None:
    follower = RotateToHeading()
    for x in (0.0, 1.0):
        follower.turn_to(2.0)
        assert follower.compute(Pose2D(x, 0.0, 0.0), Twist2D(), DT).twist.vx == 0.0
        crept = follower.compute(Pose2D(x + 0.03, 0.0, 0.0), Twist2D(), DT).twist.vx
        assert crept == pytest.approx(-5.0 * 0.01)
        back = follower.compute(Pose2D(x - 0.5, 0.0, 0.0), Twist2D(), DT).twist.vx
        assert back == RotateToHeading().max_place_speed
