"""Tactile sensors."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hal.api.part import Sensor


@dataclass(frozen=True, eq=False)
class TactileReading:
    """What a pad feels; x of its frame runs along a row, y along a column, z out of the pad.

    ``pressure``: normal force on each taxel, (rows, columns) newtons. ``shear``: force on each taxel along x and y,
    (rows, columns, 2) newtons. ``sliding``: how fast what is touched slides over the pad, (2,) m/s along x and y, as
    the optical flow of a DIGIT's picture tells; 0 where nothing touches. Forces are what the world does to the pad.
    """

    pressure: NDArray[np.float64]
    shear: NDArray[np.float64]
    sliding: NDArray[np.float64]
    stamp: float


class Tactile(Sensor):
    """A pad of pressure elements (taxels) on a finger."""

    kind: ClassVar[str] = "tactile"

    @property
    @abstractmethod
    def frame(self) -> str:
        """The frame of the pad in the robot model: in its middle, z out of it."""

    @abstractmethod
    def read(self) -> TactileReading:
        """The latest reading."""
