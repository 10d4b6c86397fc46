"""How many particles are enough: KLD-sampling (D. Fox, "Adapting the sample size in particle filters", 2003)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.bounds import Count, NotBelow, Positive, check_bounds


@dataclass(frozen=True)
class KldSampling:
    """``error``: allowed Kullback-Leibler distance, ``quantile``: of the normal distribution, for its probability.

    ``bin_size`` metres, ``bin_angle`` radians: of the bins that the particles occupy. ``fewest``, ``most``: particles.
    """

    error: Positive = 0.02
    quantile: Positive = 2.33
    bin_size: Annotated[Positive, "m"] = 0.25
    bin_angle: Annotated[Positive, "rad"] = math.radians(10.0)
    fewest: Count = 500
    most: Annotated[Count, NotBelow("fewest")] = 20000

    def __post_init__(self) -> None:
        check_bounds(self)

    def bins(self, poses: NDArray[np.float64]) -> NDArray[np.int64]:
        """A number for the bin in which each of ``poses`` (N, 3) of x, y, theta lies, (N,)."""
        column, row = np.floor(poses[:, :2].T / self.bin_size).astype(np.int64)
        turn = np.floor(poses[:, 2] % (2.0 * math.pi) / self.bin_angle).astype(np.int64)
        numbers: NDArray[np.int64] = ((column + 2**19) * 2**20 + row + 2**19) * 2**10 + turn
        return numbers

    def enough(self, occupied: int) -> int:
        """Particles that a distribution over so many occupied bins needs."""
        if occupied < 2:
            return self.fewest
        k = occupied - 1
        part = 2.0 / (9.0 * k)
        count = k / (2.0 * self.error) * (1.0 - part + math.sqrt(part) * self.quantile) ** 3
        return min(max(math.ceil(count), self.fewest), self.most)
