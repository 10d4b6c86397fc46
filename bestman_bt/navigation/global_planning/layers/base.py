"""Layers of a costmap: each knows one kind of thing that a base must keep clear of."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray


class CostmapLayer(ABC):
    """A costmap takes the nearest of what its layers have; inflation and footprint work on that."""

    @abstractmethod
    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Metres (N,) from ``points`` (2, N) in the map frame to the next thing of this kind, negative inside one.

        Infinite where there is none. The layer's own margins are already taken off.
        """

    def reaching(self, height: float) -> CostmapLayer:
        """What of it reaches up to ``height`` metres or higher: all of it, itself, where that is not known."""
        return self
