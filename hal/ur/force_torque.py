"""The force-torque sensor in the flange of e-series arms."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import Wrench
from bestman_bt.robot_model import ForceTorquePart
from hal.api import NoDataError
from hal.hardware import HardwareForceTorque
from hal.parts import StopLatch
from hal.ur.link import URLink


class URForceTorque(HardwareForceTorque):
    """Raw readings (``ft_raw_wrench``), weight of the hand included, in the frame of the flange.

    The part is to be mounted on the arm's ``tool0`` without an offset.
    """

    def __init__(self, name: str, model: ForceTorquePart, link: URLink, latch: StopLatch) -> None:
        super().__init__(name, model, latch, self._newest)
        self._link = link

    def _newest(self) -> Wrench:
        report = self._link.report
        if report is None:
            raise NoDataError(f"{self.name} has told no wrench yet")
        values = np.array(report.wrench)
        return Wrench(values[:3], values[3:], self._link.heard)
