"""The sign of the wrist's wrench: the hand's weight in two postures compared with the measurement."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.finding import CheckFinding, judged, not_applicable
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.robot_model.payload import flange_of
from bestman_bt.runtime.wrist_check import check_wrist
from hal.api import ForceTorque


def wrench(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Yield the finding of each force-torque sensor that an arm carries and that has a connection."""
    wrists = {
        name: arm
        for name, part in subject.robot.parts.items()
        for arm in subject.arms
        if isinstance(part, ForceTorque) and _carries(subject, arm, part.frame)
    }
    if not wrists:
        yield not_applicable(subject.model.name, "no arm with a force-torque sensor is behind a connection")
    for name, arm in wrists.items():
        found = check_wrist(subject.robot, arm, name)
        text = f"the hand's weight changes by {found.expected:.1f} N when {found.joint} turns, felt {found.felt:.1f} N"
        text += f": {found.fault}" if found.fault else ""
        yield judged(name, found.fault is None, text, expected_n=found.expected, felt_n=found.felt)


def _carries(subject: BroughtUpRobot, arm: str, frame: str) -> bool:
    """Return whether a link hangs on an arm's flange: it stays where it is there, however the arm turns."""
    flange, turned = flange_of(subject.model, arm), dict.fromkeys(subject.model.of(ArmModel)[arm].joint_names, 0.1)
    here, there = (subject.pose(frame, flange, moved) for moved in ({}, turned))
    return bool(np.allclose(here.matrix, there.matrix, atol=1e-6))
