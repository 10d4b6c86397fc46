"""How many particles are enough: KLD-sampling (D. Fox, "Adapting the sample size in particle filters", 2003)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages.bounds import Count, Positive, check_order


@dataclass(frozen=True)
class KldParameters:
    """``error``: allowed Kullback-Leibler distance, ``quantile``: of the normal distribution, for its probability.

    ``bin_size`` metres, ``bin_angle`` radians: of the bins that the particles occupy. ``fewest``, ``most``: particles.
    """

    error: Positive = 0.02
    quantile: Positive = 2.33
    bin_size: Annotated[Positive, "m"] = 0.25
    bin_angle: Annotated[Positive, "rad"] = math.radians(10.0)
    fewest: Count = 500
    most: Count = 20000

    def __post_init__(self) -> None:
        check_order(self, "fewest", "most")


def bins(poses: NDArray[np.float64], parameters: KldParameters) -> NDArray[np.int64]:
    """A number for the bin in which each of ``poses`` (N, 3) of x, y, theta lies, (N,)."""
    column, row = np.floor(poses[:, :2].T / parameters.bin_size).astype(np.int64)
    turn = np.floor(poses[:, 2] % (2.0 * math.pi) / parameters.bin_angle).astype(np.int64)
    numbers: NDArray[np.int64] = ((column + 2**19) * 2**20 + row + 2**19) * 2**10 + turn
    return numbers


def enough(occupied: int, parameters: KldParameters) -> int:
    """Particles that a distribution over so many occupied bins needs."""
    p = parameters
    if occupied < 2:
        return p.fewest
    k = occupied - 1
    part = 2.0 / (9.0 * k)
    count = k / (2.0 * p.error) * (1.0 - part + math.sqrt(part) * p.quantile) ** 3
    return min(max(math.ceil(count), p.fewest), p.most)
