"""The joints and the gripper of an xArm behind the vendor's SDK; millimetres and pulses end here."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import GripperModel
from hal.api import NoDataError
from hal.parts import GripperChannel, GripperReading, JointChannel, JointReading
from hal.xarm.wire import XArmWire

Array = NDArray[np.float64]
FASTEST, SLOWEST = 5000, 350
"""Speeds of the gripper's motor, revolutions per minute; the fastest is taken for the part's ``max_speed``."""


class XArmJoints(JointChannel):
    """Set-points in the controller's servo mode; readings come with the connection's cycle."""

    def __init__(self, wire: XArmWire, joints: int) -> None:
        self._wire, self._count = wire, joints
        self._reading: JointReading | None = None

    def read(self) -> JointReading:
        """The reading of the last cycle."""
        if self._reading is None:
            raise NoDataError("the xArm has told no joint positions yet")
        return self._reading

    def refresh(self) -> None:
        """Ask for positions, velocities and torques: one round trip. What is not answered leaves the last reading."""
        states = self._wire.ask(lambda arm: arm.get_joint_states(is_radian=True, num=3))
        if states is not None:
            columns = np.array(states, dtype=float)[:, : self._count]
            self._reading = JointReading(*columns)

    def send(self, positions: Array, velocities: Array) -> None:
        """One set-point, radians: one round trip."""
        self._wire.tell("set-point", lambda arm: arm.set_servo_angle_j(positions.tolist(), is_radian=True))


class XArmGripper(GripperChannel):
    """The gripper on the arm's tool bus. Its force cannot be chosen: it presses with what it has."""

    def __init__(self, wire: XArmWire, model: GripperModel, pulses: int) -> None:
        self._wire, self._model = wire, model
        self._pulses_per_metre = pulses / (model.max_width - model.part.min_width)
        self._width: float | None = None

    def refresh(self) -> None:
        """Ask for the width; what is not answered leaves the last one."""
        pulses = self._wire.ask(lambda arm: arm.get_gripper_position())
        if pulses is not None:
            self._width = self._model.part.min_width + float(pulses) / self._pulses_per_metre

    def read(self) -> GripperReading:
        """The latest width."""
        if self._width is None:
            raise NoDataError("the xArm's gripper has told no position yet")
        return GripperReading(self._width)

    def send(self, width: float, force: float, speed: float) -> None:
        """Go to a width."""
        pulses = round((width - self._model.part.min_width) * self._pulses_per_metre)
        share = speed / self._model.part.max_speed
        turns = int(np.clip(FASTEST * share, SLOWEST, FASTEST))
        self._wire.tell("gripper", lambda arm: _set_position(arm, pulses, turns))

    def halt(self) -> None:
        """Make the present width the target; it is held with what force the gripper has."""
        self.refresh()
        self.send(self.read().width, 0.0, self._model.part.max_speed)


def _set_position(arm: Any, pulses: int, turns: int) -> int:
    """Without waiting for the arm to stand still, as the SDK would; the next reading tells of errors."""
    code: int = arm.set_gripper_position(pulses, speed=turns, wait=False, wait_motion=False, check_err=False)
    return code
