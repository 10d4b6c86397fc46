"""The sign of the wrist's wrench: the hand's weight in two postures against what it feels."""

from __future__ import annotations

from collections.abc import Iterator

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.finding import Finding, judged, not_applicable
from bestman_bt.runtime.wrist_check import check_wrist
from hal.api import ForceTorque


def wrench(subject: BroughtUpRobot) -> Iterator[Finding]:
    """Of each force-torque sensor behind a connection that an arm carries."""
    sensors = [name for name, part in subject.robot.parts.items() if isinstance(part, ForceTorque)]
    if not sensors or not subject.arms:
        yield not_applicable(subject.model.name, "no arm with a force-torque sensor is behind a connection")
        return
    arm = next(iter(subject.arms))
    for name in sensors:
        found = check_wrist(subject.robot, arm, name)
        text = f"the hand's weight changes by {found.expected:.1f} N when {found.joint} turns, felt {found.felt:.1f} N"
        text += f": {found.fault}" if found.fault else ""
        yield judged(name, found.fault is None, text, expected_n=found.expected, felt_n=found.felt)
