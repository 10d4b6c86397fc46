"""The systematic error of a depth sensor, and how it is taken away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class DepthCorrection:
    """The sensor tells ``scale * z + offset`` for a depth of z; ``offset`` in metres."""

    scale: float = 1.0
    offset: float = 0.0

    def apply(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """True depths (H, W) of told ones, metres; 0 where the sensor told none, or nothing that can be."""
        if self == DepthCorrection():
            return depth
        corrected = (depth - np.float32(self.offset)) / np.float32(self.scale)
        return np.where((depth > 0.0) & (corrected > 0.0), corrected, np.float32(0.0))
