"""The force-torque sensor in the flange of e-series arms."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import Wrench
from bestman_bt.robot_model import ForceTorqueModel
from hal.api import Clock, ForceTorque, NoDataError
from hal.hardware import Fault, HardwareSensor, StopLatch
from hal.hardware.part_line import PartLine
from hal.ur.link import URLink


class URForceTorque(HardwareSensor, ForceTorque):
    """Raw readings (``ft_raw_wrench``), weight of the hand included, in the frame of the flange.

    The part is to be mounted on the arm's ``tool0`` without an offset.
    """

    def __init__(self, name: str, model: ForceTorqueModel, link: URLink, clock: Clock, latch: StopLatch) -> None:
        super().__init__(name)
        self._model, self._link, self._clock = model, link, clock
        self._line = PartLine(name, latch)

    @property
    def frame(self) -> str:
        """The frame of the wrenches."""
        return self._model.frame

    def wrench(self) -> Wrench:
        """The newest reading."""
        self._line.check_reading()
        report = self._link.report
        if report is None:
            raise NoDataError(f"{self.name} has told no wrench yet")
        values = np.array(report.wrench)
        return Wrench(values[:3], values[3:], self._link.heard)

    def attach(self) -> None:
        """The controller has connected."""
        self._line.open()

    def detach(self) -> None:
        """The controller disconnects."""
        self._line.close()

    def fail(self, fault: Fault) -> None:
        """Nothing is read of a controller that was lost."""
        self._line.fail_motion(fault)
