"""The base drives 0.2 m and turns by 30°, and back, by its own odometry."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.finding import Finding, judged, not_applicable
from bestman_bt.messages import Pose2D, wrap_angle
from hal.api import MobileBase

DISTANCE, TURN = 0.2, math.radians(30.0)
DISTANCE_TOLERANCE, TURN_TOLERANCE = 0.01, math.radians(1.5)


def of_each_base(
    look: Callable[[BroughtUpRobot, str, MobileBase], Finding],
) -> Callable[[BroughtUpRobot], Iterator[Finding]]:
    """The step that looks at each base behind a connection."""

    def step(subject: BroughtUpRobot) -> Iterator[Finding]:
        bases = {name: part for name, part in subject.robot.parts.items() if isinstance(part, MobileBase)}
        if not bases:
            yield not_applicable(subject.model.name, "no base is behind a connection")
        for name, base in bases.items():
            yield look(subject, name, base)

    return step


def _drive(subject: BroughtUpRobot, name: str, base: MobileBase) -> Finding:
    start = base.odometry()
    why = subject.finish(base.move_forward(DISTANCE))
    moved = start.inverse() @ base.odometry()
    back = subject.finish(base.move_backward(DISTANCE)) if not why else ""
    straight = abs(moved.x - DISTANCE) <= DISTANCE_TOLERANCE and abs(moved.y) <= DISTANCE_TOLERANCE
    text = f"told {DISTANCE:g} m ahead, it went {_figures(moved)}{_because(why or back)}"
    passed = straight and not why and not back
    return judged(name, passed, text, ahead_m=moved.x, aside_m=moved.y, turned_deg=math.degrees(moved.theta))


def _turn(subject: BroughtUpRobot, name: str, base: MobileBase) -> Finding:
    start = base.odometry()
    why = subject.finish(base.rotate(TURN))
    moved = start.inverse() @ base.odometry()
    back = subject.finish(base.rotate(-TURN)) if not why else ""
    there = abs(wrap_angle(moved.theta - TURN)) <= TURN_TOLERANCE
    text = f"told {math.degrees(TURN):.0f}° to the left, it went {_figures(moved)}{_because(why or back)}"
    passed = there and not why and not back
    return judged(name, passed, text, ahead_m=moved.x, aside_m=moved.y, turned_deg=math.degrees(moved.theta))


def _figures(moved: Pose2D) -> str:
    return (
        f"{1e3 * moved.x:+.0f} mm ahead, {1e3 * moved.y:+.0f} mm aside, {math.degrees(moved.theta):+.1f}° to the left"
    )


def _because(why: str) -> str:
    return f" ({why})" if why else ""


drive, turn = of_each_base(_drive), of_each_base(_turn)
