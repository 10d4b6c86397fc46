"""Batteries."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from hal.api.part import Sensor


@dataclass(frozen=True)
class BatteryReading:
    """``charge`` from 0 to 1, ``voltage`` in volts."""

    charge: float
    voltage: float
    charging: bool


class Battery(Sensor):
    """A battery."""

    kind: ClassVar[str] = "battery"

    @abstractmethod
    def read(self) -> BatteryReading:
        """The latest reading."""
