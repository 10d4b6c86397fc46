"""Batteries."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from hal.api.part import Sensor


@dataclass(frozen=True)
class BatteryReading:
    """``charge`` from 0 to 1, ``voltage`` in volts, ``current`` drawn in amperes, negative while it charges."""

    charge: float
    voltage: float
    current: float
    charging: bool
    stamp: float


class Battery(Sensor):
    """A battery."""

    kind: ClassVar[str] = "battery"

    @abstractmethod
    def read(self) -> BatteryReading:
        """The latest reading."""
