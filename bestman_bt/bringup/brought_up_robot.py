"""The robot under bring-up: connected, with the means to command and compare it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

from bestman_bt.bringup.finding import CheckFinding, not_applicable
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Pose
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import RobotModel
from hal.api import Arm, JointGroup, Motion, MotionStatus, RobotError
from hal.hardware.controller_facts import Identity
from hal.hardware.isolated_robot import IsolatedRobot

Kind = TypeVar("Kind")
POLL = 0.02
SPEED = 0.1
"""Fraction of the joints' limits at which steps move."""


@dataclass
class BroughtUpRobot:
    """The robot of a bring-up. ``name``: its name or file. ``settings``: as for ``load_robot_model``.

    ``signed_serials``, ``signed_firmware``: those from an earlier part of this bring-up, by connection.
    ``base_from_board``: the measured pose of a calibration board in the robot's base frame. ``twin``: whether its
    controllers are twins.
    """

    name: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    signed_serials: Mapping[str, str] = field(default_factory=dict)
    signed_firmware: Mapping[str, str] = field(default_factory=dict)
    base_from_board: Pose | None = None
    twin: bool = False

    @cached_property
    def model(self) -> RobotModel:
        """Return the model with the limits of its file; the steps limit their own speed."""
        return load_robot_model(self.name, self.settings)

    @cached_property
    def robot(self) -> IsolatedRobot:
        """Return the robot with its connections in a separate process, as in runs."""
        return IsolatedRobot(self.model)

    @cached_property
    def kinematics(self) -> ForwardKinematics:
        """Return the forward kinematics of the model."""
        return ForwardKinematics(self.model)

    @property
    def arms(self) -> dict[str, Arm]:
        """Arms behind connections."""
        return self.parts(Arm)

    @property
    def joint_groups(self) -> dict[str, JointGroup]:
        """Arms and other joints behind connections."""
        return self.parts(JointGroup)

    def parts(self, kind: type[Kind]) -> dict[str, Kind]:
        """Return the parts of type ``kind`` that hardware controllers serve."""
        return {name: part for name, part in self.robot.parts.items() if isinstance(part, kind)}

    def identities(self) -> dict[str, Identity]:
        """Return the identities that the controllers report."""
        return self.robot.identities()

    def joint_positions(self) -> dict[str, float]:
        """Return all joints that are read, by name."""
        return {
            joint: float(position)
            for group in self.joint_groups.values()
            for joint, position in zip(group.joint_names, group.positions(), strict=True)
        }

    def pose(self, frame: str, reference: str, moved: Mapping[str, float] | None = None) -> Pose:
        """Return reference_from_frame by the model at the current joint positions; ``moved`` replaces some of them."""
        return self.kinematics.pose(frame, {**self.joint_positions(), **(moved or {})}, reference)

    def finish(self, motion: Motion[Any]) -> str:
        """Wait for the end of ``motion``. Returns why it failed, or an empty text."""
        while not motion.done:
            self.robot.clock.sleep(POLL)
        return "" if motion.status is MotionStatus.SUCCEEDED else str(motion.failure or motion.status)

    def make_ready(self) -> None:
        """Clear a stop of an earlier step. Raises RobotError if that fails."""
        if self.robot.stopped:
            self.robot.clear_stop()

    @contextmanager
    def disconnected_robot(self) -> Iterator[None]:
        """Disconnect for the duration, because controllers accept one client. Raises RobotError if reconnecting
        fails.
        """
        self.robot.disconnect()
        try:
            yield
        finally:
            self.robot.connect()


def fault_text(error: RobotError) -> str:
    """Return the text of a fault, never empty."""
    return str(error) or type(error).__name__


def for_each_part(
    kind: type[Kind], none: str, *looks: Callable[[BroughtUpRobot, str, Kind], CheckFinding]
) -> Callable[[BroughtUpRobot], Iterator[CheckFinding]]:
    """Return the step that runs ``looks`` on each part of a ``kind``. ``none``: the reason if there is no such part."""

    def step(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
        parts = subject.parts(kind)
        if not parts:
            yield not_applicable(subject.model.name, f"{none} behind a connection")
        for name, part in parts.items():
            for look in looks:
                yield look(subject, name, part)

    return step
