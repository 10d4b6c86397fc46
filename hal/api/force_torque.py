"""Force-torque sensors."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from bestman_bt.messages import Wrench
from hal.api.part import Sensor


class ForceTorque(Sensor):
    """A six-axis force-torque sensor."""

    kind: ClassVar[str] = "force_torque"

    @property
    @abstractmethod
    def frame(self) -> str:
        """The frame of the wrenches in the robot model."""

    @abstractmethod
    def wrench(self) -> Wrench:
        """The latest wrench."""
