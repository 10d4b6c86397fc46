"""The joints of a UR arm behind the SDK's process."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hal.api import NoDataError
from hal.parts import JointChannel, JointReading
from hal.ur.link import URLink
from hal.ur.sdk_process import Report

Array = NDArray[np.float64]


class URJoints(JointChannel):
    """Set-points by ``servoJ``; the torques are those that the controller's model wants."""

    def __init__(self, link: URLink) -> None:
        self._link = link
        self._of: Report | None = None
        self._reading: JointReading | None = None

    @property
    def age(self) -> float:
        """Readings come whether set-points are sent or not."""
        return self._link.age

    def read(self) -> JointReading:
        """The newest reading."""
        report = self._link.report
        if report is None:
            raise NoDataError("the UR has told no joint positions yet")
        reading = self._reading
        if reading is None or report is not self._of:
            reading = JointReading(*(np.array(v) for v in (report.positions, report.velocities, report.torques)))
            self._of, self._reading = report, reading
        return reading

    def send(self, positions: Array, velocities: Array) -> None:
        """One set-point, radians; it does not wait."""
        self._link.send(positions.tolist())
