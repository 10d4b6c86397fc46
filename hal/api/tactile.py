"""Tactile sensors."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hal.api.part import Sensor


class Tactile(Sensor):
    """A pad of pressure elements (taxels)."""

    kind: ClassVar[str] = "tactile"

    @abstractmethod
    def read(self) -> NDArray[np.float64]:
        """Normal force per taxel, (rows, columns) newtons."""
