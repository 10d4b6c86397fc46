"""Checking straight joint motions at a given resolution."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def is_edge_valid(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    is_valid: Callable[[NDArray[np.float64]], bool],
    step: float,
) -> bool:
    """Whether all points at most ``step`` rad (Euclidean) apart between ``a`` and ``b`` are valid, ends included.

    The middle is asked first, then the quarters, so that a blocked edge is found out early.
    """
    if not (is_valid(b) and is_valid(a)):
        return False
    difference = b - a
    count = math.ceil(float(np.linalg.norm(difference)) / step)
    return all(is_valid(a + fraction * difference) for fraction in _halving_order(count))


def dense_points(path: NDArray[np.float64], step: float) -> Iterator[NDArray[np.float64]]:
    """Points (n,) along ``path`` (N, n), at most ``step`` rad (Euclidean) apart, all waypoints among them."""
    yield path[0]
    for a, b in pairwise(path):
        count = max(1, math.ceil(float(np.linalg.norm(b - a)) / step))
        for i in range(1, count + 1):
            yield a + (i / count) * (b - a)


@lru_cache(maxsize=1024)
def _halving_order(count: int) -> tuple[float, ...]:
    """The fractions i / count, 0 < i < count, from coarse to fine."""
    order: list[float] = []
    ranges = [(0, count)]
    for low, high in ranges:
        middle = (low + high) // 2
        if middle > low:
            order.append(middle / count)
            ranges += [(low, middle), (middle, high)]
    return tuple(order)
