"""Inertial measurement units."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hal.api.part import Sensor


@dataclass(frozen=True, eq=False)
class ImuReading:
    """``angular_velocity`` (3,) rad/s and ``linear_acceleration`` (3,) m/s², in the sensor's frame.

    The acceleration is the specific force: at rest it is 9.81 upwards.
    """

    angular_velocity: NDArray[np.float64]
    linear_acceleration: NDArray[np.float64]
    stamp: float


class Imu(Sensor):
    """An inertial measurement unit."""

    kind: ClassVar[str] = "imu"

    @property
    @abstractmethod
    def frame(self) -> str:
        """The frame of the readings in the robot model."""

    @abstractmethod
    def read(self) -> ImuReading:
        """The latest reading."""
