from __future__ import annotations

import math

import pytest

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.navigation.local_planning import RotateToHeading, RotateToHeadingParameters

DT = 0.025


def turned(creep: float, parameters: RotateToHeadingParameters | None = None) -> tuple[Pose2D, list[Twist2D]]:
    """Where a half turn ends that pushes the base along itself by ``creep`` metres a radian, and what was commanded."""
    follower = RotateToHeading(parameters)
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
    left_alone, _ = turned(creep, RotateToHeadingParameters(slack=math.inf))
    held, commands = turned(creep)
    assert math.hypot(left_alone.x, left_alone.y) > 0.33
    assert math.hypot(held.x, held.y) < 0.125
    assert held.theta == pytest.approx(math.pi - 0.3, abs=0.01)
    assert max(abs(twist.vx) for twist in commands) <= RotateToHeadingParameters().max_place_speed


def test_a_base_that_turns_on_the_spot_is_commanded_to_turn_alone() -> None:
    _, commands = turned(0.01)
    assert not any(twist.vx for twist in commands)
