"""What the checks need to know of a robot: its parts by kind, and how to wait for them."""

# mypy: disable-error-code="type-abstract"
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hal.api import Arm, Gripper, JointGroup, MobileBase, Motion, Part, Robot
from hal.conformance.requirement import require

PartType = TypeVar("PartType", bound=Part)
POLL = 0.05
REST_TIME = 0.5
REST_JOINT_SPEED = 0.01
REST_BASE_SPEED = 0.01


@dataclass(frozen=True)
class Check:
    """One thing that an implementation owes. ``needs``: the kinds of part without which it does not apply."""

    name: str
    run: Callable[[Robot], None]
    needs: tuple[type[Part], ...] = ()

    def applies_to(self, robot: Robot) -> bool:
        """Whether the robot has what the check needs."""
        return all(parts_of(robot, kind) for kind in self.needs)


def parts_of(robot: Robot, kind: type[PartType]) -> list[PartType]:
    """The robot's parts of a kind."""
    return [part for part in robot.parts.values() if isinstance(part, kind)]


def first(robot: Robot, kind: type[PartType]) -> PartType:
    """The first part of a kind."""
    return parts_of(robot, kind)[0]


def finish(robot: Robot, motion: Motion, limit: float = 20.0) -> None:
    """Wait for a motion; it has to end within ``limit`` seconds."""
    deadline = robot.clock.now() + limit
    while not motion.done:
        require(robot.clock.now() < deadline, f"a motion was still running after {limit} s")
        robot.clock.sleep(POLL)


def nearby(group: JointGroup, step: float = 0.3) -> NDArray[np.float64]:
    """Positions ``step`` from the present ones, towards the middle of each joint's range."""
    present = group.positions()
    middle = np.array([(limit.lower + limit.upper) / 2 for limit in group.limits])
    return np.asarray(present + np.clip(middle - present, -step, step))


def set_moving(robot: Robot) -> list[Motion]:
    """Command everything that can move, and let it get under way."""
    motions: list[Motion] = [group.move_to(nearby(group), 0.5) for group in parts_of(robot, JointGroup)]
    for gripper in parts_of(robot, Gripper):
        description = gripper.description
        middle = (description.min_width + description.max_width) / 2
        motions.append(gripper.move(description.max_width if gripper.width() < middle else description.min_width))
    for base in parts_of(robot, MobileBase):
        motions.append(base.rotate(1.0))
    robot.clock.sleep(0.2)
    return motions


def is_at_rest(robot: Robot) -> bool:
    """Whether arms, groups and bases stand still, as the API defines it."""
    for group in parts_of(robot, JointGroup):
        if np.any(np.abs(group.velocities()) > REST_JOINT_SPEED):
            return False
    for base in parts_of(robot, MobileBase):
        velocity = base.velocity()
        if max(abs(velocity.vx), abs(velocity.vy), abs(velocity.wz)) > REST_BASE_SPEED:
            return False
    return True


def require_rest(robot: Robot, after: str) -> None:
    """The robot has to be at rest, and to stay so."""
    robot.clock.sleep(REST_TIME)
    require(is_at_rest(robot), f"the robot should be at rest {REST_TIME} s after {after}")
    places = [group.positions() for group in parts_of(robot, JointGroup)]
    robot.clock.sleep(REST_TIME)
    moved = [
        float(np.max(np.abs(group.positions() - place)))
        for group, place in zip(parts_of(robot, JointGroup), places, strict=True)
    ]
    require(
        max(moved, default=0.0) < 0.01, f"joints moved by {max(moved, default=0.0):.4f} while at rest after {after}"
    )


def settle(robot: Robot) -> None:
    """Clear a stop and let everything come to rest: between two checks."""
    robot.stop()
    robot.clock.sleep(2 * REST_TIME)
    robot.clear_stop()


ARMS = (Arm,)
GROUPS = (JointGroup,)
GRIPPERS = (Gripper,)
BASES = (MobileBase,)
