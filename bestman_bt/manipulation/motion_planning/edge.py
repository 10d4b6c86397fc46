"""Points on straight joint motions, at a given resolution."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def dense_points(path: NDArray[np.float64], step: float) -> Iterator[NDArray[np.float64]]:
    """Points (n,) along ``path`` (N, n), at most ``step`` rad (Euclidean) apart, all waypoints among them."""
    yield path[0]
    for a, b in pairwise(path):
        count = max(1, math.ceil(float(np.linalg.norm(b - a)) / step))
        for i in range(1, count + 1):
            yield a + (i / count) * (b - a)


@lru_cache(maxsize=1024)
def halving_order(count: int) -> tuple[float, ...]:
    """The fractions i / count, 0 < i < count, from coarse to fine."""
    order: list[float] = []
    ranges = [(0, count)]
    for low, high in ranges:
        middle = (low + high) // 2
        if middle > low:
            order.append(middle / count)
            ranges += [(low, middle), (middle, high)]
    return tuple(order)
