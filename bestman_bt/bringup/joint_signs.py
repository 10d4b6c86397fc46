"""Each joint by one degree: it moves, by that, the way that the robot's file says, and no other joint does."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from bestman_bt.bringup.arm_against_model import model_tool_pose, turn_between
from bestman_bt.bringup.brought_up_robot import SPEED, BroughtUpRobot
from bestman_bt.bringup.finding import Finding, judged, not_applicable
from hal.api import JointGroup

STEP = math.radians(1.0)
"""Radians; sliding joints: metres."""
TOLERANCE = 0.3 * STEP
SHIFT_TOLERANCE = 0.001
"""Metres by which the controller's tool may move otherwise than ours does."""


def joint_signs(subject: BroughtUpRobot) -> Iterator[Finding]:
    """And back again; of an arm whose controller tells its tool's pose, that moves as ours does."""
    if not subject.joint_groups:
        yield not_applicable(subject.model.name, "no joints are behind a connection")
    for name, group in subject.joint_groups.items():
        yield _signs_of(subject, name, group)


def _signs_of(subject: BroughtUpRobot, name: str, group: JointGroup) -> Finding:
    worst, figures = 0.0, {}
    for index, joint in enumerate(group.joint_names):
        here = group.positions()
        before = subject.robot.arm_facts(name) if name in subject.arms else None
        middle = 0.5 * (group.model.lower[index] + group.model.upper[index])
        there = here.copy()
        there[index] += STEP if here[index] <= middle else -STEP
        why = subject.finish(group.move_to(there, SPEED))
        moved = group.positions() - here
        shift = 0.0
        if before is not None and (after := subject.robot.arm_facts(name)) is not None:
            start, end = (model_tool_pose(subject, name, told) for told in (before, after))
            theirs = after.tool_pose.position - before.tool_pose.position
            shift = float(np.linalg.norm(theirs - (end.position - start.position)))
            turned = turn_between(before.tool_pose.inverse() @ after.tool_pose, start.inverse() @ end)
            shift = max(shift, turned * SHIFT_TOLERANCE / TOLERANCE)
        subject.finish(group.move_to(here, SPEED))
        error = float(np.max(np.abs(moved - (there - here))))
        worst = max(worst, error)
        figures[joint] = round(math.degrees(float(moved[index])), 3)
        asked = math.degrees(there[index] - here[index])
        if error > TOLERANCE:
            text = f"{joint} was told {asked:+.2f}° and moved {figures[joint]:+.2f}°{f' ({why})' if why else ''}"
            return judged(name, False, text, **figures)
        if shift > SHIFT_TOLERANCE:
            text = (
                f"the controller's tool moves {1e3 * shift:.1f} mm otherwise than ours when {joint} turns {asked:+.0f}°"
            )
            return judged(name, False, text, **figures)
    text = f"{len(group.joint_names)} joints moved as told, within {math.degrees(worst):.2f}°"
    return judged(name, True, text, **figures)
