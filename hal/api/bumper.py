"""Bumpers: rings of contact strips around a base."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from hal.api.part import Sensor


@dataclass(frozen=True)
class BumperZone:
    """A strip that tells one bit; ``start``, ``end``: (x, y) metres in the base frame, counter-clockwise."""

    start: tuple[float, float]
    end: tuple[float, float]

    @property
    def middle(self) -> tuple[float, float]:
        """(x, y), metres, in the base frame."""
        return (self.start[0] + self.end[0]) / 2.0, (self.start[1] + self.end[1]) / 2.0


@dataclass(frozen=True)
class BumperReading:
    """``pressed``: indices of the zones that something presses on."""

    pressed: tuple[int, ...]
    stamp: float


class Bumper(Sensor):
    """A ring of contact strips around the chassis of a base."""

    kind: ClassVar[str] = "bumper"

    @property
    @abstractmethod
    def zones(self) -> tuple[BumperZone, ...]:
        """The strips, counter-clockwise from the front right corner on; readable before connecting."""

    @abstractmethod
    def read(self) -> BumperReading:
        """The latest reading."""
