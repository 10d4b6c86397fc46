"""The positions of all joints of a robot, by name."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from bestman_bt.control.history import History, positions_between
from hal.api import Clock, Gripper, JointGroup, NoDataError, NotConnectedError, Part, Timer

if TYPE_CHECKING:
    from bestman_bt.robot_model.model import RobotModel


READING_ERRORS = (NotConnectedError, NoDataError)
"""Errors that readings of a robot may raise: a controller is lost, or a sensor is silent; see their ``code``."""


RECORDING_RATE = 50.0
"""Hertz at which positions are recorded between ``start`` and ``close``."""


class JointStateSensor:
    """Reads the encoders of arms, other joint groups and grippers, but not of wheels.

    A gripper reports only its width; its joint positions come from the robot model. Between ``start`` and ``close`` it
    records positions, for queries of earlier times.
    """

    def __init__(self, parts: Mapping[str, Part], model: RobotModel) -> None:
        from bestman_bt.robot_model.model import GripperModel

        self._parts, self._grippers = parts, model.of(GripperModel)
        self._history = History(positions_between)
        self._clock: Clock | None = None
        self._timer: Timer | None = None

    def start(self, clock: Clock) -> None:
        """Record the positions from now on, by the robot's clock."""
        self.close()
        self._clock = clock
        self._record()
        self._timer = clock.every(1.0 / RECORDING_RATE, self._record)

    def close(self) -> None:
        """Stop recording; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
        self._clock = self._timer = None
        self._history.clear()

    def at(self, stamp: float) -> Mapping[str, float]:
        """Return the positions at a time of the robot's clock, seconds; without a recording, the current ones.

        Raises NotRecordedError outside the recorded time, READING_ERRORS as ``positions``.
        """
        positions = self.positions()
        if self._clock is None:
            return positions
        self._history.add(self._clock.now(), positions)
        return self._history.at(stamp)

    def _record(self) -> None:
        assert self._clock is not None
        with contextlib.suppress(*READING_ERRORS):  # a gap; the caller that moves the joints gets the reason
            self._history.add(self._clock.now(), self.positions())

    def positions(self) -> Mapping[str, float]:
        """Return joint name → measured position, radians or metres. Raises READING_ERRORS if a part reports none."""
        positions: dict[str, float] = {}
        for name, part in self._parts.items():
            if isinstance(part, JointGroup):
                positions.update(zip(part.joint_names, part.positions().tolist(), strict=True))
            elif isinstance(part, Gripper) and name in self._grippers:
                positions.update(self._grippers[name].joint_positions(part.width()))
        return MappingProxyType(positions)
